// SPDX-License-Identifier: Apache-2.0
// Verify mode: what a pass states against what its commands do.
#include <gmock/gmock.h>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Verify : public BackendTest {
  public:
    /// A device of its own with verify mode on, and a pass that reads `input` and writes `output`.
    struct Setup {
        std::unique_ptr<Device> device;
        Buffer input, output;
        ComputePipeline pipeline;
        BindGroup group;
    };
    Setup set_up(bool verify) {
        DeviceDesc desc = device_desc();
        desc.verify_statements = verify;
        Setup setup;
        setup.device = make_device(desc);
        setup.input = ok(setup.device->create_buffer({.size = 64, .usage = BufferUsage::storage, .name = "input"}));
        setup.output = ok(setup.device->create_buffer({.size = 64, .usage = BufferUsage::storage, .name = "output"}));
        setup.pipeline = ok(setup.device->create_compute_pipeline(
            {.shader = ok(setup.device->create_shader(compile(ShaderStage::compute, R"(
                layout(local_size_x = 16) in;
                layout(set = 0, binding = 0) readonly buffer Input { uint values[]; };
                layout(set = 0, binding = 1) buffer Output { uint results[]; };
                void main() { results[gl_LocalInvocationIndex] = values[gl_LocalInvocationIndex] + 1u; })"))),
             .name = "increment"}));
        setup.group = ok(setup.device->create_bind_group(
            {.layout = ok(setup.device->bind_group_layout(setup.pipeline, 0)),
             .entries = {{.binding = 0, .buffer = setup.input}, {.binding = 1, .buffer = setup.output}},
             .name = "increment"}));
        return setup;
    }

    /// Runs the pass under a statement and returns the texts of verify messages.
    std::vector<std::string> run_stated(Setup& setup, std::vector<StatedAccess> statement) {
        CommandList list = setup.device->create_command_list("list");
        list.begin_statement("increment", statement);
        list.set_pipeline(setup.pipeline);
        list.set_bind_group(0, setup.group);
        list.dispatch({});
        list.end_statement();
        const auto submitted = setup.device->submit(std::move(list));
        EXPECT_TRUE(submitted) << "a wrong statement is reported, and changes nothing";
        std::vector<std::string> texts;
        for (const Message& message : messages())
            if (message.source == MessageSource::verify) texts.push_back(message.text);
        return texts;
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Verify);
INSTANTIATE_TEST_SUITE_P(Rhi, Verify, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(Verify, TrueStatementsAreSilent) {
    Setup setup = set_up(true);
    EXPECT_TRUE(
        run_stated(setup, {{.buffer = setup.input, .use = ResourceUse::storage_read},
                           {.buffer = setup.output, .use = ResourceUse::storage_read | ResourceUse::storage_write}})
            .empty());
}

TEST_P(Verify, AMissingAccessIsReported) {
    Setup setup = set_up(true);
    expect_message("N-7");
    const auto texts = run_stated(
        setup, {{.buffer = setup.output, .use = ResourceUse::storage_read | ResourceUse::storage_write}});
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_THAT(texts[0], AllOf(HasSubstr("increment"), HasSubstr("'input'")));
}

TEST_P(Verify, AWriteStatedAsReadIsReported) {
    Setup setup = set_up(true);
    expect_message("N-7");
    const auto texts = run_stated(setup, {{.buffer = setup.input, .use = ResourceUse::storage_read},
                                          {.buffer = setup.output, .use = ResourceUse::storage_read}});
    ASSERT_FALSE(texts.empty());
    EXPECT_THAT(texts[0], HasSubstr("'output'"));
}

TEST_P(Verify, AnAccessThatNeverHappensIsReported) {
    Setup setup = set_up(true);
    const Buffer other = ok(setup.device->create_buffer({.size = 64, .usage = BufferUsage::storage, .name = "other"}));
    expect_message("N-7");
    const auto texts = run_stated(
        setup, {{.buffer = setup.input, .use = ResourceUse::storage_read},
                {.buffer = other, .use = ResourceUse::storage_read},
                {.buffer = setup.output, .use = ResourceUse::storage_read | ResourceUse::storage_write}});
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_THAT(texts[0], HasSubstr("'other'"));
}

TEST_P(Verify, OffMeansSilent) {
    Setup setup = set_up(false);
    EXPECT_TRUE(run_stated(setup, {}).empty());
}

}  // namespace
}  // namespace nacre::test
