// SPDX-License-Identifier: Apache-2.0
// What the documents promise about the tree.
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <sstream>

#include "tests/project/source_tree.h"

namespace nacre {
namespace {

TEST(SourceFiles, StartWithTheLicense) {
    const auto files =
        source_files({".h", ".cpp", ".glsl", ".vert", ".frag", ".comp", ".cmake", "CMakeLists.txt", ".awk"});
    EXPECT_GT(files.size(), 50U);
    for (const std::string& file : files)
        EXPECT_NE(text_of(file).substr(0, 300).find("SPDX-License-Identifier: Apache-2.0"), std::string::npos) << file;
}

TEST(Documents, NameEveryEnvironmentVariable) {
    const std::string documented = text_of("docs/command-line.md");
    const std::regex use("getenv\\(\"(NACRE_[A-Z_]+)\"\\)");
    std::set<std::string> used;
    for (const std::string& file : source_files({".h", ".cpp"})) {
        if (file.starts_with("tests/")) continue;
        const std::string text = text_of(file);
        for (std::sregex_iterator match(text.begin(), text.end(), use), end; match != end; ++match)
            used.insert((*match)[1]);
    }
    EXPECT_TRUE(used.contains("NACRE_CACHE_DIR"));
    for (const std::string& variable : used)
        EXPECT_NE(documented.find("`" + variable), std::string::npos) << variable << " is not in docs/command-line.md";
}

TEST(Documents, LinksLeadToFilesThatExist) {
    std::vector<std::filesystem::path> documents;
    for (const auto& folder : {source_root, source_root / "docs"})
        for (const auto& entry : std::filesystem::directory_iterator(folder))
            if (entry.path().extension() == ".md") documents.push_back(entry.path());
    EXPECT_GT(documents.size(), 3U);
    const std::regex link("\\]\\(([^)#:]+)(#[^)]*)?\\)");
    for (const auto& document : documents) {
        // Code between fences holds brackets that are no links.
        std::string text;
        std::istringstream lines(read_text_file(document).value());
        bool is_code = false;
        for (std::string line; std::getline(lines, line);) {
            if (line.starts_with("```"))
                is_code = !is_code;
            else if (!is_code)
                text += line + '\n';
        }
        for (std::sregex_iterator match(text.begin(), text.end(), link), end; match != end; ++match)
            EXPECT_TRUE(std::filesystem::exists(document.parent_path() / (*match)[1].str()))
                << document << " links to " << (*match)[1];
    }
}

TEST(Documents, TheReadmeShowsThePassThatIsCompiled) {
    const std::string sample = text_of("samples/write_a_pass.cpp");
    const std::string opening = "// [a pass in 40 lines]\n";
    const std::size_t begin = sample.find(opening) + opening.size();
    const std::size_t end = sample.find("// [end]");
    ASSERT_LT(begin, end);
    const std::string pass = sample.substr(begin, end - begin);
    EXPECT_LE(std::ranges::count(pass, '\n'), 42);
    EXPECT_NE(text_of("README.md").find("```cpp\n" + pass + "```"), std::string::npos)
        << "README.md shows another pass than samples/write_a_pass.cpp";
}

TEST(Samples, AreShorterThanAHundredLines) {
    for (const char* sample : {"samples/triangle.cpp", "samples/compute.cpp"}) {
        const auto lines = std::ranges::count(text_of(sample), '\n');
        EXPECT_TRUE(lines > 10 && lines < 100) << sample << " has " << lines;
    }
}

}  // namespace
}  // namespace nacre
