// SPDX-License-Identifier: Apache-2.0
#include "core/progress.h"

#include <gmock/gmock.h>

#include <memory>
#include <string>

namespace nacre {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class ProgressTest : public testing::Test {
  protected:
    ProgressOutput output(ProgressOutput::Style style) {
        ProgressOutput result;
        result.file = file_.get();
        result.style = style;
        result.delay = result.line_interval = result.plain_interval = std::chrono::milliseconds(0);
        return result;
    }
    std::string written() {
        std::fflush(file_.get());
        std::rewind(file_.get());
        std::string text(4096, '\0');
        text.resize(std::fread(text.data(), 1, text.size(), file_.get()));
        return text;
    }
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_{std::tmpfile(), std::fclose};
};

TEST_F(ProgressTest, ALineNamesStepCountAndItemAndVanishesAtTheEnd) {
    {
        Progress progress("compiling shaders", 12, output(ProgressOutput::Style::line));
        progress.update(3, "lighting.comp");
        progress.update(4, "sky.frag");
    }
    EXPECT_EQ(written(), "compiling shaders 3/12: lighting.comp\r\033[Kcompiling shaders 4/12: sky.frag\r\033[K");
}

TEST_F(ProgressTest, PlainLinesHaveNoControlCharacters) {
    {
        Progress progress("building tables", 0, output(ProgressOutput::Style::plain));
        progress.update(0, "ggx");
    }
    EXPECT_THAT(written(), HasSubstr("building tables: ggx\nbuilding tables: done in"));
    EXPECT_THAT(written(), Not(HasSubstr("\033")));
}

TEST_F(ProgressTest, ShortStepsAndHiddenOnesShowNothing) {
    {
        ProgressOutput patient = output(ProgressOutput::Style::plain);
        patient.delay = std::chrono::hours(1);
        Progress progress("short", 0, patient);
        progress.update(1);
        Progress hidden("hidden", 0, output(ProgressOutput::Style::hidden));
        hidden.update(1);
    }
    EXPECT_THAT(written(), IsEmpty());
}

TEST_F(ProgressTest, OnlyTheInnermostStepIsShown) {
    {
        Progress outer("outer", 0, output(ProgressOutput::Style::line));
        {
            Progress inner("inner", 0, output(ProgressOutput::Style::line));
            outer.update(1);
            inner.update(2);
        }
        outer.update(3);
    }
    EXPECT_EQ(written(), "inner 2\r\033[Kouter 3\r\033[K");
}

TEST_F(ProgressTest, ALongLineIsCutToTheTerminalBetweenCharacters) {
    {
        Progress progress("a", 0, output(ProgressOutput::Style::line));
        progress.update(0, std::string(75, 'x') + "\u00e9\u00e9");
    }
    EXPECT_EQ(written(), "a: " + std::string(75, 'x') + "\r\033[K");
}

TEST_F(ProgressTest, OtherLinesGoInBetween) {
    {
        Progress progress("step", 0, output(ProgressOutput::Style::line));
        progress.update(1);
        {
            const ProgressLinePause pause;
            std::fputs("message\n", file_.get());
        }
        progress.update(2);
    }
    EXPECT_EQ(written(), "step 1\r\033[Kmessage\nstep 2\r\033[K");
}

}  // namespace
}  // namespace nacre
