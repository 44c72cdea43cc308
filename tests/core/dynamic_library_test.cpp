// SPDX-License-Identifier: Apache-2.0
#include "core/dynamic_library.h"

#include <dlfcn.h>
#include <gmock/gmock.h>

namespace nacre {
namespace {

using testing::HasSubstr;

TEST(DynamicLibrary, OpensTheFirstNameThatExists) {
    auto library = DynamicLibrary::open({"libdoes-not-exist.so.9", "libm.so.6"}, "libc6");
    ASSERT_TRUE(library) << library.error().message();
    EXPECT_EQ(library->name(), "libm.so.6");
    auto cosine = library->symbol<double (*)(double)>("cos");
    ASSERT_TRUE(cosine) << cosine.error().message();
    EXPECT_EQ((*cosine)(0.0), 1.0);
}

TEST(DynamicLibrary, ErrorNamesWhatWasTriedTheReasonAndThePackage) {
    auto library = DynamicLibrary::open({"libfirst-missing.so", "libsecond-missing.so"}, "libmissing1");
    ASSERT_FALSE(library);
    EXPECT_EQ(library.error().code, ErrorCode::not_found);
    const std::string message = library.error().message();
    EXPECT_THAT(message, HasSubstr("'libfirst-missing.so', 'libsecond-missing.so'"));
    EXPECT_THAT(message, HasSubstr("cannot open shared object file"));
    EXPECT_THAT(message, HasSubstr("apt-get install libmissing1"));
}

TEST(DynamicLibrary, MissingSymbolIsAnErrorThatNamesIt) {
    auto library = DynamicLibrary::open({"libm.so.6"}, "");
    ASSERT_TRUE(library);
    auto symbol = library->symbol<void (*)()>("no_such_function");
    ASSERT_FALSE(symbol);
    EXPECT_THAT(symbol.error().message(), HasSubstr("'no_such_function' in library 'libm.so.6'"));
    EXPECT_EQ(library->find<void (*)()>("no_such_function"), nullptr);
    EXPECT_FALSE(DynamicLibrary().symbol<void (*)()>("cos"));
}

// A library of the C library that nothing else here loads.
TEST(DynamicLibrary, ClosesWhenDestroyedUnlessResident) {
    const auto is_loaded = [](const char* name) {
        void* handle = dlopen(name, RTLD_NOW | RTLD_NOLOAD);
        if (handle) dlclose(handle);
        return handle != nullptr;
    };
    const char* name = "libnss_hesiod.so.2";
    ASSERT_FALSE(is_loaded(name));
    {
        auto library = DynamicLibrary::open({name}, "libc6");
        ASSERT_TRUE(library) << library.error().message();
        DynamicLibrary moved = *std::move(library);
        EXPECT_TRUE(moved);
        EXPECT_FALSE(*library);
        EXPECT_TRUE(is_loaded(name));
        moved = DynamicLibrary();
        EXPECT_FALSE(is_loaded(name));
    }
    ASSERT_TRUE(DynamicLibrary::open({name}, "libc6", LibraryLifetime::resident));
    EXPECT_TRUE(is_loaded(name));
}

}  // namespace
}  // namespace nacre
