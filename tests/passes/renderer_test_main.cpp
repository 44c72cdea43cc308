// SPDX-License-Identifier: Apache-2.0
// Runs the tests of all backends and makes sure that each backend that is here ran some.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <map>
#include <set>
#include <string>

#include "tests/passes/renderer_test.h"

namespace {

class Counter : public ::testing::EmptyTestEventListener {
  public:
    void OnTestEnd(const ::testing::TestInfo& info) override {
        const std::string name = info.name();
        if (!info.result()->Skipped()) ++executed[name.substr(name.rfind('/') + 1)];
    }
    std::map<std::string, int> executed;
};

}  // namespace

int main(int argc, char** argv) {
    // llvmpipe's default filter is not conformant; this has to be known before it is loaded.
    setenv("GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx", 1);
    ::testing::InitGoogleTest(&argc, argv);
    auto* counter = new Counter;
    ::testing::UnitTest::GetInstance()->listeners().Append(counter);
    int status = RUN_ALL_TESTS();
    nacre::test::release_devices();
    if (::testing::GTEST_FLAG(filter) != "*" || ::testing::GTEST_FLAG(list_tests)) return status;
    if (nacre::test::render_variants().empty()) {
        std::cerr << "no backend is here: nothing was tested\n";
        return 1;
    }
    const auto& tests = *::testing::UnitTest::GetInstance();
    std::set<std::string> variants;
    for (int i = 0; i < tests.total_test_suite_count(); ++i) {
        const ::testing::TestSuite& suite = *tests.GetTestSuite(i);
        for (int k = 0; k < suite.total_test_count(); ++k) {
            const std::string name = suite.GetTestInfo(k)->name();
            if (name.find('/') != std::string::npos) variants.insert(name.substr(name.rfind('/') + 1));
        }
    }
    for (const std::string& variant : variants) {
        if (counter->executed[variant] == 0) {
            std::cerr << "backend " << variant << " is here and ran no test\n";
            status = 1;
        }
    }
    return status;
}
