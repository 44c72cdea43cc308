// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/fake_compiler.h"

#include <map>

namespace nacre::cpu {
namespace {

std::map<std::string, ComputeProgram> compute_programs;
std::map<std::string, VertexProgram> vertex_programs;
std::map<std::string, FragmentProgram> fragment_programs;

class FakeCompiler : public Compiler {
  public:
    Expected<ComputeProgram> compile_compute(const ShaderSource& source) override {
        return find(compute_programs, source);
    }
    Expected<VertexProgram> compile_vertex(const ShaderSource& source, const VertexInput&) override {
        return find(vertex_programs, source);
    }
    Expected<FragmentProgram> compile_fragment(const ShaderSource& source) override {
        return find(fragment_programs, source);
    }

  private:
    template <typename Program>
    static Expected<Program> find(const std::map<std::string, Program>& programs, const ShaderSource& source) {
        FakePrograms::last_slots.assign(source.slots.begin(), source.slots.end());
        const auto found = programs.find(std::string(source.name));
        if (found == programs.end())
            return fail(ErrorCode::unsupported, "compile shader", std::string(source.name), "no program was set");
        Program program = found->second;
        program.name = source.name;
        return program;
    }
};

}  // namespace

std::vector<BindingSlots> FakePrograms::last_slots;
CompilerOptions FakePrograms::last_options;

void FakePrograms::set(const std::string& name, ComputeProgram program) { compute_programs[name] = std::move(program); }
void FakePrograms::set(const std::string& name, VertexProgram program) { vertex_programs[name] = std::move(program); }
void FakePrograms::set(const std::string& name, FragmentProgram program) {
    fragment_programs[name] = std::move(program);
}

Expected<std::unique_ptr<Compiler>> Compiler::create(const CompilerOptions& options) {
    FakePrograms::last_options = options;
    return std::make_unique<FakeCompiler>();
}

std::uint32_t native_lanes() { return 8; }

}  // namespace nacre::cpu
