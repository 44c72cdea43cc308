// SPDX-License-Identifier: Apache-2.0
#include "measure/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "measure/base64.h"
#include "tests/core/temporary_folder.h"

namespace nacre::measure {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string base64_of(std::string_view text) { return base64(std::as_bytes(std::span(text))); }

// The examples of RFC 4648, section 10.
TEST(Base64Test, FollowsTheStandard) {
    EXPECT_EQ(base64_of(""), "");
    EXPECT_EQ(base64_of("f"), "Zg==");
    EXPECT_EQ(base64_of("fo"), "Zm8=");
    EXPECT_EQ(base64_of("foo"), "Zm9v");
    EXPECT_EQ(base64_of("foobar"), "Zm9vYmFy");
    EXPECT_EQ(base64_of("\xff\xfe\xfd"), "//79");
}

ReportPage sample_page() {
    ReportPage page{.title = "a <b> & \"c\"", .tone = ReportTone::good, .verdict = "fine"};
    page.tables.push_back({.title = "figures", .columns = {"name"}, .rows = {{{"<script>alert(1)</script>"}}}});
    page.pictures.push_back({"one", "caption", ImageBytes{2, 1, 3, 1, {1, 2, 3, 4, 5, 6}}});
    page.galleries.push_back({"small", "", {{"other size", "", ImageBytes{1, 1, 3, 1, {1, 2, 3}}}}});
    return page;
}

TEST(ReportPageTest, HoldsEverythingItself) {
    const auto html = report_page_html(sample_page());
    ASSERT_TRUE(html) << html.error().message();
    EXPECT_THAT(*html, HasSubstr("src=\"data:image/png;base64,iVBORw0KGgo"));
    EXPECT_THAT(*html, HasSubstr("clip-path"));        // the style
    EXPECT_THAT(*html, HasSubstr("querySelector"));    // the script
    EXPECT_THAT(*html, HasSubstr("'dragstart'"));      // else browsers drag the picture and not the border
    EXPECT_THAT(*html, Not(HasSubstr("http://")));
    EXPECT_THAT(*html, Not(HasSubstr("https://")));
    EXPECT_THAT(*html, Not(HasSubstr("<link")));
}

TEST(ReportPageTest, TextIsEscaped) {
    const auto html = report_page_html(sample_page());
    ASSERT_TRUE(html);
    EXPECT_THAT(*html, HasSubstr("a &lt;b&gt; &amp; &quot;c&quot;"));
    EXPECT_THAT(*html, Not(HasSubstr("<script>alert")));
}

TEST(ReportPageTest, ViewerTakesPicturesOfOneSize) {
    const auto html = report_page_html(sample_page());
    ASSERT_TRUE(html);
    EXPECT_THAT(*html, HasSubstr("data-name=\"one\" data-viewer=\"1\""));
    EXPECT_THAT(*html, HasSubstr("data-name=\"other size\" data-viewer=\"0\""));
}

TEST(ReportPageTest, BadPictureIsAnError) {
    ReportPage page = sample_page();
    page.pictures[0].picture.bytes.clear();
    EXPECT_FALSE(report_page_html(page));
}

TEST(ReportPageTest, IsWritten) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_report_page(folder.path() / "sub" / "index.html", sample_page()));
    std::ifstream stream(folder.path() / "sub" / "index.html");
    const std::string text((std::istreambuf_iterator<char>(stream)), {});
    EXPECT_TRUE(text.starts_with("<!DOCTYPE html>"));
    EXPECT_THAT(text, HasSubstr("</html>"));
}

}  // namespace
}  // namespace nacre::measure
