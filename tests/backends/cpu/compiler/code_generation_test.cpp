// SPDX-License-Identifier: Apache-2.0
// What LLVM's instruction selection does not survive in some versions must not reach it. A failure is a timeout.
#include <gtest/gtest.h>
#include <llvm/AsmParser/Parser.h>
#include <llvm/IR/LLVMContext.h>
#include <llvm/Support/SourceMgr.h>

#include "backends/cpu/compiler/code.h"

namespace nacre::cpu {
namespace {

#if defined(__x86_64__)
TEST(CodeGeneration, UsesTheInstructionsOfTheProcessor) {
    const bool has_half = __builtin_cpu_supports("avx2"), has_exponents = __builtin_cpu_supports("avx512vl");
    for (const bool contract : {false, true}) {
        const auto generator = CodeGenerator::create(16, contract);
        ASSERT_TRUE(generator) << generator.error().message();
        const MathOptions& options = (*generator)->math_options();
        EXPECT_EQ(options.contract, contract);
        // Processors with AVX2 have F16C.
        EXPECT_TRUE(options.half_instructions || !has_half);
        // Their results are not the bits of other processors.
        EXPECT_EQ(options.exponent_instructions, contract && has_exponents);
        EXPECT_EQ(options.conversion_instructions, has_exponents);
    }
}
#endif

TEST(CodeGeneration, EndsForJoinedMasksOfScalarConditions) {
    const auto generator = CodeGenerator::create(8, false);
    ASSERT_TRUE(generator) << generator.error().message();
    llvm::LLVMContext context;
    llvm::SMDiagnostic problem;
    const auto module = llvm::parseAssemblyString(R"(
        define void @kernel(i32 %number, i1 %other, ptr %to) {
        slots:
          %is_zero = icmp eq i32 %number, 0
          %first = select i1 %is_zero, <8 x i1> <i1 true, i1 true, i1 true, i1 true, i1 true, i1 true, i1 true, i1 true>, <8 x i1> zeroinitializer
          %second = select i1 %other, <8 x i1> <i1 true, i1 true, i1 true, i1 true, i1 true, i1 true, i1 true, i1 true>, <8 x i1> zeroinitializer
          %either = or <8 x i1> %second, %first
          br label %batch
        batch:
          br i1 %other, label %block, label %next
        block:
          %a = load <8 x i32>, ptr %to
          %b = select <8 x i1> %first, <8 x i32> %a, <8 x i32> zeroinitializer
          store volatile <8 x i32> %b, ptr %to
          br label %next
        next:
          %mask = phi <8 x i1> [ %either, %block ], [ %second, %batch ]
          %c = load volatile <8 x i32>, ptr %to
          %d = select <8 x i1> %mask, <8 x i32> %c, <8 x i32> zeroinitializer
          store volatile <8 x i32> %d, ptr %to
          br label %batch
        })",
                                                  problem, context);
    ASSERT_TRUE(module) << problem.getMessage().str();
    (*generator)->prepare(*module);
    const auto object = (*generator)->compile(*module, "masks", false);
    ASSERT_TRUE(object) << object.error().message();
    EXPECT_FALSE(object->bytes.empty());
}

}  // namespace
}  // namespace nacre::cpu
