// SPDX-License-Identifier: Apache-2.0
// A negative test for each message that the validation layer can give; a rule without one fails the suite.
#include "rhi/validation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>

#include "tests/rhi/validation_breaches.h"

namespace nacre::test {
namespace {

using namespace rhi;
using enum Format;

std::vector<Breach> all_breaches() {
    std::vector<Breach> all;
    for (auto& part : {handle_breaches(), resource_breaches(), group_breaches(), pipeline_breaches(), pass_breaches(),
                       draw_breaches(), copy_breaches(), structure_breaches(), other_breaches()})
        all.insert(all.end(), part.begin(), part.end());
    return all;
}

TEST(Validation, EachRuleIsToldWithNamesExpectationFindingAndMend) {
    for (const Breach& breach : all_breaches()) {
        SCOPED_TRACE(breach.code);
        Capabilities capabilities = full_capabilities();
        DeviceDesc desc;
        if (breach.weaken) breach.weaken(capabilities);
        if (breach.ask) breach.ask(desc);
        Bench bench(desc, capabilities);
        breach.act(bench);
        ASSERT_EQ(bench.messages().size(), 1u) << (bench.messages().empty() ? "" : bench.messages().back().text);
        const Message& message = bench.messages().front();
        EXPECT_TRUE(message.code.starts_with(breach.code + " ")) << message.code << ": " << message.text;
        EXPECT_NE(message.text.find(message.code), std::string::npos) << message.text;
        EXPECT_EQ(message.severity, MessageSeverity::error);
        const bool verify = message.source == MessageSource::verify;
        EXPECT_TRUE(verify || (message.text.find("expected") != std::string::npos &&
                               message.text.find("found") != std::string::npos))
            << message.text;
        // The mend is the last sentence, behind the code.
        EXPECT_GT(message.text.size(), message.text.find("]") + 10) << message.text;
    }
}

TEST(Validation, EachRuleHasATest) {
    std::set<std::string> tested, known;
    for (const Breach& breach : all_breaches()) tested.insert(breach.code);
    for (const ValidationRule& rule : validation_rules()) {
        known.insert(std::string(rule.code.substr(0, 5)));
        EXPECT_FALSE(rule.meaning.empty());
    }
    EXPECT_EQ(tested, known);
}

TEST(Validation, NumbersRiseAndNamesAreUnique) {
    std::set<std::string_view> names;
    std::string_view last;
    for (const ValidationRule& rule : validation_rules()) {
        EXPECT_LT(last, rule.code);
        last = rule.code;
        EXPECT_TRUE(names.insert(rule.code.substr(6)).second) << rule.code;
    }
}

/// Text of docs/validation.md.
std::string document() {
    std::string text =
        "# Messages of the validation layer\n\n"
        "Generated from the rules (`NACRE_UPDATE_DOCS=1 rhi_front_end_test`). Every message names its code, the "
        "objects by the\n"
        "names that they were given, what was expected, what was found, and what to change:\n\n"
        "```text\n"
        "draw list 'frame', pass 'lighting', pipeline 'tone': expected a bind group at index 0, found none\n"
        "[N-523 bind-group-missing]. Call set_bind_group before; the begin and the end of a render pass unset all of "
        "them.\n"
        "```\n\n"
        "The text is the same on every backend, because a backend sees valid calls only. Codes never change their "
        "meaning.\n"
        "Descriptions and handles are checked on every device; what is recorded is checked in full where "
        "`DeviceDesc::validation` is on\n"
        "(the default), and for the order of passes, missing pipelines, missing bindings and the range of copies "
        "always. A call that\n"
        "breaks a rule does nothing, returns an `Error` with the same text, and reports a `Message` to\n"
        "`Device::set_message_callback`.\n\n"
        "| code | meaning |\n|---|---|\n";
    for (const ValidationRule& rule : validation_rules())
        text += "| `" + std::string(rule.code) + "` | " + std::string(rule.meaning) + " |\n";
    text +=
        "\n## What shaders do while they run\n\n"
        "Found by backends that are asked to look for it ([cpu.md](cpu.md), \"Fault finders\"); the source of these "
        "messages is\n`MessageSource::shader`.\n\n"
        "| code | meaning |\n|---|---|\n";
    for (const ValidationRule& fault : shader_faults())
        text += "| `" + std::string(fault.code) + "` | " + std::string(fault.meaning) + " |\n";
    return text;
}

TEST(Validation, DocumentListsEveryRule) {
    const std::string path = std::string(NACRE_SOURCE_DIR) + "/docs/validation.md";
    if (std::getenv("NACRE_UPDATE_DOCS")) std::ofstream(path) << document();
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    EXPECT_EQ(text.str(), document()) << "run NACRE_UPDATE_DOCS=1 rhi_front_end_test";
}

TEST(Validation, FirstErrorOfAListIsKeptAndReturned) {
    Bench bench;
    CommandList list = bench.list();
    list.dispatch({});
    list.draw({.vertex_count = 3});
    ASSERT_FALSE(list.status());
    EXPECT_EQ(bench.messages().size(), 1u);
    const auto submitted = bench.device().submit(std::move(list));
    ASSERT_FALSE(submitted);
    EXPECT_NE(submitted.error().message().find("N-520"), std::string::npos);
    EXPECT_EQ(bench.messages().size(), 1u);
    EXPECT_TRUE(bench.log().submissions.empty());
    EXPECT_TRUE(bench.device().submit(bench.list()));
}

TEST(Validation, WhatMustNeverReachADriverIsFoundWithoutIt) {
    DeviceDesc desc;
    desc.validation = false;
    // Codes that hold in every build, with validation off as well.
    const std::set<std::string> always{"N-101", "N-105", "N-106", "N-107", "N-501", "N-502", "N-511", "N-520",
                                       "N-523", "N-524", "N-525", "N-528", "N-531", "N-570", "N-571"};
    int tried = 0;
    for (const Breach& breach : all_breaches()) {
        if (!always.contains(breach.code) || breach.weaken) continue;
        Bench bench(desc);
        // The acts that only record are submitted by nobody; those that submit must fail.
        breach.act(bench);
        for (const Message& message : bench.messages())
            EXPECT_TRUE(message.code.starts_with(breach.code)) << message.text;
        tried += bench.messages().empty() ? 0 : 1;
    }
    EXPECT_GE(tried, 7);

    const auto refused = [&](const std::function<void(Bench&, CommandList&)>& record) {
        Bench bench(desc);
        CommandList list = bench.list();
        record(bench, list);
        return !bench.device().submit(std::move(list));
    };
    EXPECT_TRUE(refused([](Bench&, CommandList& l) { l.draw({.vertex_count = 3}); }));
    EXPECT_TRUE(refused([](Bench&, CommandList& l) { l.dispatch({}); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) {
        l.set_pipeline(b.compute(storage_shader));
        l.dispatch({});
    }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.begin_render_pass({.color = {{.view = b.target()}}}); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) {
        l.begin_render_pass({.color = {{.view = b.target()}}});
        l.draw({.vertex_count = 3});
        l.end_render_pass();
    }));
    EXPECT_TRUE(refused([](Bench&, CommandList& l) { l.end_render_pass(); }));
    EXPECT_TRUE(
        refused([](Bench& b, CommandList& l) { l.copy_buffer(b.buffer(copies), 200, b.buffer(copies), 0, 57); }));
    EXPECT_TRUE(refused(
        [](Bench& b, CommandList& l) { l.copy_buffer_to_texture(b.buffer(copies), b.texture(texture_copies)); }));
    EXPECT_TRUE(refused(
        [](Bench& b, CommandList& l) { l.copy_texture_to_buffer(b.texture(texture_copies), b.buffer(copies)); }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) {
        l.copy_texture(b.texture(texture_copies), b.texture(texture_copies), {.source_layer = 7});
    }));
    EXPECT_TRUE(refused([](Bench& b, CommandList& l) { l.fill_buffer(b.buffer(copies), 0, 0, 1024); }));
    EXPECT_FALSE(refused([](Bench& b, CommandList& l) {
        l.begin_render_pass({.color = {{.view = b.target()}}});
        l.set_pipeline(b.graphics());
        l.draw({.vertex_count = 3});
        l.end_render_pass();
    }));
}

}  // namespace
}  // namespace nacre::test
