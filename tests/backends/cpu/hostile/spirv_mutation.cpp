// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/hostile/spirv_mutation.h"

#include <algorithm>
#include <utility>

namespace nacre::hostile {

using spv::Op;

namespace {

bool ends_block(Op op) {
    switch (op) {
        case Op::OpBranch: case Op::OpBranchConditional: case Op::OpSwitch: case Op::OpReturn: case Op::OpReturnValue:
        case Op::OpKill: case Op::OpUnreachable: case Op::OpTerminateInvocation:
            return true;
        default: return false;
    }
}

/// Shapes a function or a block: neither copied nor moved.
bool is_structural(Op op) {
    switch (op) {
        case Op::OpFunction:
        case Op::OpFunctionParameter:
        case Op::OpFunctionEnd:
        case Op::OpLabel:
        case Op::OpSelectionMerge:
        case Op::OpLoopMerge: case Op::OpPhi: case Op::OpVariable: case Op::OpLine: case Op::OpNoLine:
            return true;
        default: return ends_block(op);
    }
}

bool is_id(spv_operand_type_t kind) {
    return kind == SPV_OPERAND_TYPE_ID || kind == SPV_OPERAND_TYPE_MEMORY_SEMANTICS_ID ||
           kind == SPV_OPERAND_TYPE_SCOPE_ID;
}

bool is_constant(Op op) {
    return (op >= Op::OpConstantTrue && op <= Op::OpSpecConstantOp) || op == Op::OpUndef;
}

/// Instructions of each row have the same kinds of operands and results.
const std::vector<std::vector<Op>>& equal_signatures() {
    static const std::vector<std::vector<Op>> rows{
        {Op::OpIAdd, Op::OpISub, Op::OpIMul, Op::OpUDiv, Op::OpSDiv, Op::OpUMod, Op::OpSRem, Op::OpSMod,
         Op::OpShiftRightLogical, Op::OpShiftRightArithmetic, Op::OpShiftLeftLogical, Op::OpBitwiseOr, Op::OpBitwiseXor,
         Op::OpBitwiseAnd},
        {Op::OpFAdd, Op::OpFSub, Op::OpFMul, Op::OpFDiv, Op::OpFRem, Op::OpFMod},
        {Op::OpIEqual, Op::OpINotEqual, Op::OpUGreaterThan, Op::OpSGreaterThan, Op::OpUGreaterThanEqual,
         Op::OpSGreaterThanEqual, Op::OpULessThan, Op::OpSLessThan, Op::OpULessThanEqual, Op::OpSLessThanEqual},
        {Op::OpFOrdEqual, Op::OpFUnordEqual, Op::OpFOrdNotEqual, Op::OpFUnordNotEqual, Op::OpFOrdLessThan,
         Op::OpFUnordLessThan, Op::OpFOrdGreaterThan, Op::OpFUnordGreaterThan, Op::OpFOrdLessThanEqual,
         Op::OpFUnordLessThanEqual, Op::OpFOrdGreaterThanEqual, Op::OpFUnordGreaterThanEqual},
        {Op::OpLogicalEqual, Op::OpLogicalNotEqual, Op::OpLogicalOr, Op::OpLogicalAnd},
        {Op::OpSNegate, Op::OpNot, Op::OpBitReverse, Op::OpCopyObject},
        {Op::OpFNegate, Op::OpCopyObject, Op::OpDPdx, Op::OpDPdy, Op::OpFwidth, Op::OpDPdxFine, Op::OpDPdyFine,
         Op::OpFwidthFine, Op::OpDPdxCoarse, Op::OpDPdyCoarse, Op::OpFwidthCoarse},
        {Op::OpConvertFToU, Op::OpConvertFToS},
        {Op::OpConvertSToF, Op::OpConvertUToF},
        {Op::OpUConvert, Op::OpSConvert},
        {Op::OpIsNan, Op::OpIsInf},
        {Op::OpAny, Op::OpAll},
        {Op::OpLogicalNot, Op::OpCopyObject},
        {Op::OpBitFieldSExtract, Op::OpBitFieldUExtract},
        {Op::OpAtomicExchange, Op::OpAtomicIAdd, Op::OpAtomicISub, Op::OpAtomicSMin, Op::OpAtomicUMin, Op::OpAtomicSMax,
         Op::OpAtomicUMax, Op::OpAtomicAnd, Op::OpAtomicOr, Op::OpAtomicXor},
        {Op::OpAtomicIIncrement, Op::OpAtomicIDecrement, Op::OpAtomicLoad},
        {Op::OpGroupNonUniformAll, Op::OpGroupNonUniformAny},
        {Op::OpGroupNonUniformShuffle, Op::OpGroupNonUniformShuffleXor, Op::OpGroupNonUniformShuffleUp,
         Op::OpGroupNonUniformShuffleDown, Op::OpGroupNonUniformBroadcast, Op::OpGroupNonUniformQuadBroadcast},
        {Op::OpGroupNonUniformIAdd, Op::OpGroupNonUniformIMul, Op::OpGroupNonUniformSMin, Op::OpGroupNonUniformUMin,
         Op::OpGroupNonUniformSMax, Op::OpGroupNonUniformUMax, Op::OpGroupNonUniformBitwiseAnd,
         Op::OpGroupNonUniformBitwiseOr, Op::OpGroupNonUniformBitwiseXor},
        {Op::OpGroupNonUniformFAdd, Op::OpGroupNonUniformFMul, Op::OpGroupNonUniformFMin, Op::OpGroupNonUniformFMax},
        {Op::OpReturn, Op::OpKill, Op::OpUnreachable, Op::OpTerminateInvocation},
        {Op::OpAccessChain, Op::OpInBoundsAccessChain},
        {Op::OpVectorTimesMatrix, Op::OpMatrixTimesVector},
        {Op::OpMatrixTimesScalar, Op::OpVectorTimesScalar},
        {Op::OpImageSampleImplicitLod, Op::OpImageSampleExplicitLod, Op::OpImageSampleProjImplicitLod},
    };
    return rows;
}

/// Instructions of GLSL.std.450 by what they take: float, two, three; integer, two, three.
constexpr std::array<std::uint32_t, 25> unary_float{1,  2,  3,  4,  6,  8,  10, 11, 12, 13, 14, 15, 16,
                                                    17, 18, 19, 20, 21, 27, 28, 29, 30, 31, 32, 69};
constexpr std::array<std::uint32_t, 11> binary_float{25, 26, 37, 40, 48, 71, 79, 80, 25, 26, 48};
constexpr std::array<std::uint32_t, 7> ternary_float{43, 46, 49, 50, 70, 81, 46};
constexpr std::array<std::uint32_t, 5> unary_integer{5, 7, 73, 74, 75};
constexpr std::array<std::uint32_t, 4> binary_integer{38, 39, 41, 42};
constexpr std::array<std::uint32_t, 2> ternary_integer{44, 45};

}  // namespace

// ---- Words

spv_result_t MutableModule::add_parsed(void* to, const spv_parsed_instruction_t* from) {
    auto& module = *static_cast<MutableModule*>(to);
    Instruction made;
    made.op = static_cast<Op>(from->opcode);
    made.type = from->type_id, made.result = from->result_id;
    made.words.assign(from->words, from->words + from->num_words);
    for (std::uint16_t i = 0; i < from->num_operands; ++i)
        made.operands.push_back({from->operands[i].offset, from->operands[i].num_words, from->operands[i].type});
    module.instructions_.push_back(std::move(made));
    return SPV_SUCCESS;
}

std::optional<MutableModule> MutableModule::parse(std::span<const std::uint32_t> words) {
    static const spv_context context = spvContextCreate(SPV_ENV_UNIVERSAL_1_6);
    if (words.size() < 5) return std::nullopt;
    MutableModule module;
    std::copy_n(words.begin(), 5, module.header_.begin());
    module.bound_ = words[3];
    if (spvBinaryParse(context, &module, words.data(), words.size(), nullptr, &MutableModule::add_parsed, nullptr) !=
            SPV_SUCCESS ||
        module.instructions_.empty())
        return std::nullopt;
    module.find_places();
    return module;
}

void MutableModule::find_places() {
    first_type_ = first_function_ = instructions_.size();
    for (std::size_t i = 0; i < instructions_.size(); ++i) {
        const Instruction& at = instructions_[i];
        if (at.result) definitions_.emplace(at.result, i);
        const bool is_global = (at.op >= Op::OpTypeVoid && at.op <= Op::OpTypeForwardPointer) || is_constant(at.op) ||
                               at.op == Op::OpVariable;
        if (is_global) first_type_ = std::min(first_type_, i);
        if (at.op == Op::OpFunction) first_function_ = std::min(first_function_, i);
        if (at.op == Op::OpExtInstImport && at.words.size() > 4 && at.words[2] == 0x4c534c47)
            glsl_set_ = at.result;  // "GLSL"
    }
    first_type_ = std::min(first_type_, first_function_);
}

Words MutableModule::words() const {
    Words made(header_.begin(), header_.end());
    made[3] = bound_;
    const auto add = [&](const Instruction& at) {
        made.push_back(static_cast<std::uint32_t>(at.words.size() << 16) | static_cast<std::uint32_t>(at.op));
        made.insert(made.end(), at.words.begin() + 1, at.words.end());
    };
    for (std::size_t i = 0; i <= instructions_.size(); ++i) {
        if (i == first_type_) std::ranges::for_each(annotations_, add);
        if (i == first_function_) std::ranges::for_each(globals_, add);
        if (i < instructions_.size()) add(instructions_[i]);
    }
    std::ranges::for_each(functions_, add);
    return made;
}

void mutate_words(Words& words, Random& random) {
    if (words.size() < 6) {
        words.resize(6 + static_cast<std::size_t>(random.below(20)));
        words[0] = spv::MagicNumber, words[1] = 0x10300, words[3] = 100;
        return;
    }
    const auto place = [&] { return 5 + static_cast<std::size_t>(random.below(static_cast<int>(words.size() - 5))); };
    switch (random.below(6)) {
        case 0:
            words[place()] =
                static_cast<std::uint32_t>(random.below(static_cast<int>(std::clamp(words[3], 1u, 1u << 20))));
            break;
        case 1: words[place()] ^= 1u << random.below(32); break;
        case 2: words[place()] = words[place()] + static_cast<std::uint32_t>(random.between(-2, 2)); break;
        case 3: words[1] = 0x10000 + 0x100 * static_cast<std::uint32_t>(random.below(7)); break;
        case 4: words.erase(words.begin() + static_cast<std::ptrdiff_t>(place())); break;
        default: words.insert(words.begin() + static_cast<std::ptrdiff_t>(place()), words[place()]); break;
    }
}

// ---- What there is

const MutableModule::Instruction* MutableModule::definition(Id id) const {
    const auto found = definitions_.find(id);
    return found == definitions_.end() ? nullptr : &instructions_[found->second];
}

Id MutableModule::type_of(Id id) const {
    const Instruction* found = definition(id);
    return found ? found->type : 0;
}

bool MutableModule::is_numeric(Id id, Op scalar) const {
    const Instruction* found = type(id);
    if (found && found->op == Op::OpTypeVector) found = type(found->words[2]);
    return found && found->op == scalar;
}

bool MutableModule::is_plain(Id id, int depth) const {
    const Instruction* found = type(id);
    if (!found || depth > 16) return false;
    switch (found->op) {
        case Op::OpTypeBool:
        case Op::OpTypeInt:
        case Op::OpTypeFloat:
        case Op::OpTypeVector:
        case Op::OpTypeMatrix: return true;
        case Op::OpTypeArray: return is_plain(found->words[2], depth + 1);
        case Op::OpTypeStruct:
            return std::all_of(found->words.begin() + 2, found->words.end(),
                               [&](Id member) { return is_plain(member, depth + 1); });
        default: return false;
    }
}

std::size_t MutableModule::function_begin(std::size_t position) const {
    while (position > first_function_ && instructions_[position].op != Op::OpFunction) --position;
    return position;
}

std::size_t MutableModule::label_before(std::size_t position) const {
    while (position > first_function_ && instructions_[position].op != Op::OpLabel) --position;
    return position;
}

std::size_t MutableModule::terminator_behind(std::size_t position) const {
    while (position + 1 < instructions_.size() && !ends_block(instructions_[position].op)) ++position;
    return position;
}

std::pair<std::size_t, std::size_t> MutableModule::insertion_range(std::size_t label) const {
    std::size_t first = label + 1;
    while (first + 1 < instructions_.size() &&
           (instructions_[first].op == Op::OpPhi || instructions_[first].op == Op::OpVariable ||
            instructions_[first].op == Op::OpLine || instructions_[first].op == Op::OpNoLine))
        ++first;
    std::size_t last = terminator_behind(label);
    if (last > first &&
        (instructions_[last - 1].op == Op::OpSelectionMerge || instructions_[last - 1].op == Op::OpLoopMerge))
        --last;
    return {std::min(first, last), last};
}

Id MutableModule::find_value(Id of_type, std::size_t before, Id other_than) {
    if (!of_type) return 0;
    std::vector<Id> local, global;
    for (std::size_t i = function_begin(before); i < before; ++i)
        if (instructions_[i].type == of_type && instructions_[i].op != Op::OpFunction &&
            instructions_[i].result != other_than)
            local.push_back(instructions_[i].result);
    for (std::size_t i = first_type_; i < first_function_; ++i)
        if (instructions_[i].type == of_type && instructions_[i].result != other_than)
            global.push_back(instructions_[i].result);
    if (!local.empty() && (global.empty() || random_->chance(75))) return random_->pick(local);
    return global.empty() ? 0 : random_->pick(global);
}

Id MutableModule::find_value(const std::function<bool(Id)>& is_wanted, std::size_t before) {
    std::vector<Id> types;
    for (std::size_t i = first_type_; i < first_function_; ++i)
        if (instructions_[i].result && is_wanted(instructions_[i].result)) types.push_back(instructions_[i].result);
    for (int i = 0; i < 4 && !types.empty(); ++i)
        if (const Id found = find_value(random_->pick(types), before)) return found;
    return 0;
}

std::optional<std::size_t> MutableModule::find_instruction(const std::function<bool(const Instruction&)>& is_wanted) {
    std::vector<std::size_t> found;
    for (std::size_t i = first_function_; i < instructions_.size(); ++i)
        if (is_wanted(instructions_[i])) found.push_back(i);
    if (found.empty()) return std::nullopt;
    return random_->pick(found);
}

std::optional<std::size_t> MutableModule::find_block(bool may_be_loop_header) {
    std::vector<std::size_t> found;
    for (std::size_t i = first_function_; i < instructions_.size(); ++i) {
        if (instructions_[i].op != Op::OpLabel) continue;
        const std::size_t end = terminator_behind(i);
        if (may_be_loop_header || instructions_[end - 1].op != Op::OpLoopMerge) found.push_back(i);
    }
    if (found.empty()) return std::nullopt;
    return random_->pick(found);
}

Id MutableModule::find_type(Op op, std::initializer_list<std::uint32_t> operands) {
    const auto is_equal = [&](const Instruction& at) {
        return at.op == op && at.words.size() == operands.size() + 2 &&
               std::equal(operands.begin(), operands.end(), at.words.begin() + 2);
    };
    for (std::size_t i = first_type_; i < first_function_; ++i)
        if (is_equal(instructions_[i])) return instructions_[i].result;
    for (const Instruction& at : globals_)
        if (is_equal(at)) return at.result;
    return 0;
}

// ---- What is made

MutableModule::Instruction MutableModule::make(Op op, Id of_type, Id result, std::initializer_list<Id> rest) {
    Instruction made;
    made.op = op, made.type = of_type, made.result = result;
    made.words.push_back(0);
    if (of_type) made.words.push_back(of_type);
    if (result) made.words.push_back(result);
    made.words.insert(made.words.end(), rest.begin(), rest.end());
    return made;
}

Id MutableModule::type_like(Op op, std::initializer_list<std::uint32_t> operands) {
    if (const Id found = find_type(op, operands)) return found;
    globals_.push_back(make(op, 0, fresh(), operands));
    return globals_.back().result;
}

Id MutableModule::constant(Id of_type, std::uint64_t bits) {
    const Instruction* found = type(of_type);
    Instruction made = make(Op::OpConstant, of_type, fresh(), {static_cast<std::uint32_t>(bits)});
    if (found && found->words[2] == 64) made.words.push_back(static_cast<std::uint32_t>(bits >> 32));
    globals_.push_back(std::move(made));
    return globals_.back().result;
}

Id MutableModule::null_of(Id of_type) {
    globals_.push_back(make(random_->chance(70) ? Op::OpConstantNull : Op::OpUndef, of_type, fresh(), {}));
    return globals_.back().result;
}

std::uint32_t MutableModule::interesting_word() {
    if (random_->chance(25)) return static_cast<std::uint32_t>(random_->below(70));
    if (random_->chance(15)) return 1u << random_->below(32);
    if (random_->chance(10)) return static_cast<std::uint32_t>(random_->next());
    return random_->pick({0u,          1u,          2u,          3u,          31u,         32u,
                          33u,         63u,         64u,         255u,        65535u,      ~0u,
                          ~1u,         0x80000000u, 0x7fffffffu, 0x7f800000u, 0xff800000u, 0x7fc00000u,
                          0x3f800000u, 0xbf800000u, 0x4f000000u, 1u << 20,    1u << 30});
}

Id MutableModule::interesting_constant(Id of_type) {
    const Instruction* found = type(of_type);
    if (!found) return 0;
    if (found->op == Op::OpTypeInt || found->op == Op::OpTypeFloat) {
        std::uint64_t bits = interesting_word();
        const std::uint32_t width = found->words[2];
        if (width == 64) bits |= std::uint64_t{interesting_word()} << 32;
        const bool is_signed = found->op == Op::OpTypeInt && found->words[3] != 0;
        // Narrow numbers fill their word as their sign tells.
        if (width < 32) {
            bits &= (std::uint64_t{1} << width) - 1;
            if (is_signed && (bits >> (width - 1))) bits |= ~std::uint64_t{0} << width;
        }
        return constant(of_type, bits);
    }
    if (found->op == Op::OpTypeBool) {
        globals_.push_back(make(random_->chance(50) ? Op::OpConstantTrue : Op::OpConstantFalse, of_type, fresh(), {}));
        return globals_.back().result;
    }
    if (found->op == Op::OpTypeVector) {
        Instruction made = make(Op::OpConstantComposite, of_type, 0, {});
        made.result = fresh();
        made.words.push_back(made.result);
        for (std::uint32_t i = 0; i < found->words[3]; ++i) made.words.push_back(interesting_constant(found->words[2]));
        globals_.push_back(std::move(made));
        return globals_.back().result;
    }
    return is_plain(of_type) ? null_of(of_type) : 0;
}

Id MutableModule::index_value(std::size_t before, std::uint32_t count) {
    const auto is_scalar_integer = [&](Id id) { return type(id)->op == Op::OpTypeInt; };
    if (random_->chance(60))
        if (const Id found = find_value(is_scalar_integer, before)) return found;
    Id word = find_type(Op::OpTypeInt, {32u, 0u});
    if (!word) word = type_like(Op::OpTypeInt, {32u, 1u});
    if (random_->chance(50))
        return constant(word,
                        static_cast<std::uint32_t>(random_->below(static_cast<int>(std::clamp(count, 1u, 1u << 20)))));
    return constant(word,
                    random_->pick({count, count + 1, ~0u, 0x80000000u, 0x7fffffffu, 1u << 28, 1u << 16, 0xfffffff0u}));
}

void MutableModule::insert(std::size_t before, std::vector<Instruction> made) {
    instructions_.insert(instructions_.begin() + static_cast<std::ptrdiff_t>(before),
                         std::make_move_iterator(made.begin()), std::make_move_iterator(made.end()));
}

void MutableModule::use_later(Id value, std::size_t from) {
    const Instruction* made = nullptr;
    for (const Instruction& at : instructions_)
        if (at.result == value) made = &at;
    if (!made) return;
    const Id of_type = made->type;
    std::vector<std::uint32_t*> places;
    for (std::size_t i = from; i < instructions_.size() && instructions_[i].op != Op::OpFunctionEnd; ++i) {
        Instruction& at = instructions_[i];
        if (at.op == Op::OpPhi || at.op == Op::OpVariable || at.result == value) continue;
        for (const Operand& operand : at.operands)
            if (is_id(operand.kind) && at.words[operand.first] != value && type_of(at.words[operand.first]) == of_type)
                places.push_back(&at.words[operand.first]);
        if (places.size() > 8) break;
    }
    if (!places.empty()) *random_->pick(places) = value;
}

std::vector<MutableModule::Instruction> MutableModule::cloned(std::size_t first, std::size_t end,
                                                              std::unordered_map<Id, Id>& renamed) {
    std::vector<Instruction> made;
    for (std::size_t i = first; i < end; ++i) {
        if (is_structural(instructions_[i].op)) continue;
        Instruction copy = instructions_[i];
        for (const Operand& operand : copy.operands)
            if (is_id(operand.kind))
                if (const auto found = renamed.find(copy.words[operand.first]); found != renamed.end())
                    copy.words[operand.first] = found->second;
        if (copy.result) {
            const Id result = fresh();
            renamed[copy.result] = result;
            copy.result = result;
            copy.words[copy.type ? 2 : 1] = result;
        }
        made.push_back(std::move(copy));
    }
    return made;
}

void MutableModule::rename_predecessor(Id from, Id to, std::size_t within) {
    for (std::size_t i = function_begin(within); i < instructions_.size() && instructions_[i].op != Op::OpFunctionEnd;
         ++i)
        if (instructions_[i].op == Op::OpPhi)
            for (std::size_t word = 4; word < instructions_[i].words.size(); word += 2)
                if (instructions_[i].words[word] == from) instructions_[i].words[word] = to;
}

// ---- Changes

bool MutableModule::replace_operand() {
    const auto position = find_instruction([](const Instruction& at) {
        return at.op != Op::OpLabel && at.op != Op::OpFunction && at.operands.size() > 0;
    });
    if (!position) return false;
    Instruction& at = instructions_[*position];
    std::vector<std::size_t> places;
    for (const Operand& operand : at.operands)
        if (is_id(operand.kind) && type_of(at.words[operand.first])) places.push_back(operand.first);
    if (places.empty()) return false;
    const std::size_t place = random_->pick(places);
    const Id of_type = type_of(at.words[place]);
    // A phi may take what comes behind it, where that is on the way round a loop.
    std::size_t before = *position;
    if (at.op == Op::OpPhi && random_->chance(50))
        while (before + 1 < instructions_.size() && instructions_[before].op != Op::OpFunctionEnd) ++before;
    Id found = random_->chance(15) ? interesting_constant(of_type) : find_value(of_type, before, at.words[place]);
    if (!found) found = interesting_constant(of_type);
    if (!found) return false;
    at.words[place] = found;
    return true;
}

bool MutableModule::change_constant() {
    std::vector<std::size_t> places;
    for (std::size_t i = first_type_; i < first_function_; ++i)
        if (instructions_[i].op == Op::OpConstant || instructions_[i].op == Op::OpSpecConstant) places.push_back(i);
    if (places.empty()) return false;
    Instruction& at = instructions_[random_->pick(places)];
    const Instruction* kind = type(at.type);
    if (!kind || kind->words.size() < 3 || kind->words[2] < 32) return false;
    at.words[3 + static_cast<std::size_t>(random_->below(static_cast<int>(at.words.size() - 3)))] = interesting_word();
    return true;
}

bool MutableModule::change_array_length() {
    std::vector<std::size_t> places;
    for (std::size_t i = first_type_; i < first_function_; ++i)
        if (instructions_[i].op == Op::OpTypeArray) places.push_back(i);
    if (places.empty()) return false;
    Instruction& at = instructions_[random_->pick(places)];
    // The constant must come before the type.
    std::vector<Id> lengths;
    for (std::size_t i = first_type_; i < definitions_[at.result]; ++i)
        if (instructions_[i].op == Op::OpConstant && type(instructions_[i].type)->op == Op::OpTypeInt)
            lengths.push_back(instructions_[i].result);
    if (lengths.empty()) return false;
    at.words[3] = random_->pick(lengths);
    return true;
}

bool MutableModule::change_opcode() {
    const auto row_of = [](Op op) -> const std::vector<Op>* {
        for (const std::vector<Op>& row : equal_signatures())
            if (std::ranges::find(row, op) != row.end()) return &row;
        return nullptr;
    };
    const auto position = find_instruction([&](const Instruction& at) { return row_of(at.op) != nullptr; });
    if (!position) return false;
    Instruction& at = instructions_[*position];
    at.op = random_->pick(*row_of(at.op));
    return true;
}

bool MutableModule::change_extended() {
    const auto position =
        find_instruction([&](const Instruction& at) { return at.op == Op::OpExtInst && at.words[3] == glsl_set_; });
    if (!position) return false;
    Instruction& at = instructions_[*position];
    const auto any_of = [&](const auto& numbers) {
        return numbers[static_cast<std::size_t>(random_->below(static_cast<int>(numbers.size())))];
    };
    const bool is_float = is_floating(at.type);
    switch (at.words.size()) {
        case 6: at.words[4] = is_float ? any_of(unary_float) : any_of(unary_integer); break;
        case 7: at.words[4] = is_float ? any_of(binary_float) : any_of(binary_integer); break;
        case 8: at.words[4] = is_float ? any_of(ternary_float) : any_of(ternary_integer); break;
        default: return false;
    }
    return true;
}

bool MutableModule::change_literal() {
    const Instruction* chosen = nullptr;
    std::vector<std::uint32_t*> places;
    // Of all literals and flags; those of functions more often than others.
    const bool in_functions = random_->chance(60);
    for (std::size_t i = in_functions ? first_function_ : 0;
         i < (in_functions ? instructions_.size() : first_function_); ++i) {
        Instruction& at = instructions_[i];
        if (at.op == Op::OpCapability || at.op == Op::OpConstant || at.op == Op::OpMemoryModel ||
            at.op == Op::OpSource || at.op == Op::OpLine)
            continue;
        for (const Operand& operand : at.operands) {
            if (is_id(operand.kind) || operand.kind == SPV_OPERAND_TYPE_TYPE_ID ||
                operand.kind == SPV_OPERAND_TYPE_RESULT_ID || operand.kind == SPV_OPERAND_TYPE_LITERAL_STRING ||
                operand.kind == SPV_OPERAND_TYPE_EXTENSION_INSTRUCTION_NUMBER)
                continue;
            places.push_back(&at.words[operand.first]);
            chosen = &at;
        }
    }
    if (!chosen) return false;
    std::uint32_t& word = *random_->pick(places);
    switch (random_->below(4)) {
        case 0: word += 1; break;
        case 1: word -= 1; break;
        case 2: word ^= 1u << random_->below(6); break;
        default: word = random_->chance(70) ? static_cast<std::uint32_t>(random_->below(9)) : interesting_word(); break;
    }
    return true;
}

bool MutableModule::change_index() {
    const auto is_chain = [](const Instruction& at) {
        return ((at.op == Op::OpAccessChain || at.op == Op::OpInBoundsAccessChain) && at.words.size() > 4) ||
               at.op == Op::OpVectorExtractDynamic || at.op == Op::OpVectorInsertDynamic;
    };
    const auto position = find_instruction(is_chain);
    if (!position) return false;
    const std::size_t words = instructions_[*position].words.size();
    const std::size_t first = instructions_[*position].op == Op::OpVectorInsertDynamic ? 5 : 4;
    const std::size_t place = first + static_cast<std::size_t>(random_->below(static_cast<int>(words - first)));
    const Id index = index_value(*position, 4);
    instructions_[*position].words[place] = index;
    return true;
}

bool MutableModule::change_terminator() {
    const auto position = find_instruction([](const Instruction& at) { return ends_block(at.op); });
    if (!position) return false;
    Instruction& at = instructions_[*position];
    const std::size_t begin = function_begin(*position);
    std::vector<Id> labels;
    for (std::size_t i = begin; i < instructions_.size() && instructions_[i].op != Op::OpFunctionEnd; ++i)
        if (instructions_[i].op == Op::OpLabel) labels.push_back(instructions_[i].result);
    if (at.op == Op::OpBranchConditional) {
        if (random_->chance(50)) std::swap(at.words[2], at.words[3]);
        else if (random_->chance(50)) at.words[2 + static_cast<std::size_t>(random_->below(2))] = random_->pick(labels);
        else if (const Id found = find_value(type_of(at.words[1]), *position)) at.words[1] = found;
        return true;
    }
    if (at.op == Op::OpSwitch && at.words.size() >= 5) {
        const std::size_t cases = (at.words.size() - 3) / 2;
        if (type(type_of(at.words[1])) && type(type_of(at.words[1]))->words[2] != 32) return false;
        switch (random_->below(4)) {
            case 0: at.words.insert(at.words.end(), {interesting_word(), random_->pick(labels)}); break;
            case 1: at.words.insert(at.words.end(), {interesting_word(), at.words[2]}); break;
            case 2:
                at.words[3 + 2 * static_cast<std::size_t>(random_->below(static_cast<int>(cases)))] =
                    interesting_word();
                break;
            default:
                std::swap(at.words[2],
                          at.words[4 + 2 * static_cast<std::size_t>(random_->below(static_cast<int>(cases)))]);
                break;
        }
        return true;
    }
    if (at.op == Op::OpBranch) {
        at.words[1] = random_->pick(labels);
        return true;
    }
    return false;
}

bool MutableModule::remove_instruction() {
    const auto position = find_instruction([](const Instruction& at) { return !is_structural(at.op); });
    if (!position) return false;
    const Id result = instructions_[*position].result, of_type = instructions_[*position].type;
    if (result) {
        Id other = random_->chance(70) ? find_value(of_type, *position, result) : 0;
        if (!other && is_plain(of_type)) other = interesting_constant(of_type);
        for (std::size_t i = first_function_; i < instructions_.size(); ++i)
            for (const Operand& operand : instructions_[i].operands)
                if (is_id(operand.kind) && instructions_[i].words[operand.first] == result) {
                    if (!other) return false;
                    instructions_[i].words[operand.first] = other;
                }
    }
    instructions_.erase(instructions_.begin() + static_cast<std::ptrdiff_t>(*position));
    if (result)
        std::erase_if(instructions_, [&](const Instruction& at) {
            return (at.op == Op::OpName || at.op == Op::OpDecorate) && at.words[1] == result;
        });
    // Places have moved by what was erased before them.
    definitions_.clear();
    find_places();
    return true;
}

bool MutableModule::duplicate_instruction() {
    const auto position = find_instruction([](const Instruction& at) { return !is_structural(at.op); });
    if (!position) return false;
    std::unordered_map<Id, Id> renamed;
    std::vector<Instruction> copies = cloned(*position, *position + 1, renamed);
    if (copies.empty()) return false;
    const Id result = copies.back().result;
    // Somewhere behind, in the same block.
    const std::size_t end = insertion_range(label_before(*position)).second;
    if (end <= *position) return false;
    const std::size_t to = *position + 1 + static_cast<std::size_t>(random_->below(static_cast<int>(end - *position)));
    insert(to, std::move(copies));
    if (result) use_later(result, to + 1);
    return true;
}

bool MutableModule::swap_instructions() {
    const auto position = find_instruction([](const Instruction& at) { return !is_structural(at.op); });
    if (!position || *position + 1 >= instructions_.size() || is_structural(instructions_[*position + 1].op))
        return false;
    std::swap(instructions_[*position], instructions_[*position + 1]);
    return true;
}

bool MutableModule::insert_operation() {
    const auto label = find_block(true);
    if (!label) return false;
    const auto [first, last] = insertion_range(*label);
    const std::size_t at = first + static_cast<std::size_t>(random_->below(static_cast<int>(last - first + 1)));
    const auto is_value = [&](Id id) {
        const Op op = type(id)->op;
        return op == Op::OpTypeInt || op == Op::OpTypeFloat || op == Op::OpTypeBool || op == Op::OpTypeVector ||
               op == Op::OpTypeMatrix;
    };
    const Id a = find_value(is_value, at);
    if (!a) return false;
    const Id of_type = type_of(a);
    const auto other = [&] {
        const Id found = random_->chance(80) ? find_value(of_type, at) : 0;
        return found ? found : interesting_constant(of_type);
    };
    const Instruction* kind = type(of_type);
    const bool is_vector = kind->op == Op::OpTypeVector;
    const std::uint32_t components = is_vector ? kind->words[3] : 1;
    const Id scalar = is_vector ? kind->words[2] : of_type;
    std::vector<Instruction> made;
    const auto add = [&](Op op, Id result_type, std::initializer_list<Id> operands) {
        made.push_back(make(op, result_type, fresh(), operands));
        return made.back().result;
    };
    if (glsl_set_ && random_->chance(20) && (is_integer(of_type) || is_floating(of_type))) {
        const auto any_of = [&](const auto& numbers) {
            return numbers[static_cast<std::size_t>(random_->below(static_cast<int>(numbers.size())))];
        };
        const bool is_float = is_floating(of_type);
        switch (random_->below(3)) {
            case 0:
                add(Op::OpExtInst, of_type, {glsl_set_, is_float ? any_of(unary_float) : any_of(unary_integer), a});
                break;
            case 1:
                add(Op::OpExtInst, of_type,
                    {glsl_set_, is_float ? any_of(binary_float) : any_of(binary_integer), a, other()});
                break;
            default:
                add(Op::OpExtInst, of_type,
                    {glsl_set_, is_float ? any_of(ternary_float) : any_of(ternary_integer), a, other(), other()});
                break;
        }
    } else if (is_vector && random_->chance(45)) {
        switch (random_->below(4)) {
            case 0: add(Op::OpVectorExtractDynamic, scalar, {a, index_value(at, components)}); break;
            case 1: {
                const Id part = find_value(scalar, at);
                add(Op::OpVectorInsertDynamic, of_type,
                    {a, part ? part : interesting_constant(scalar), index_value(at, components)});
                break;
            }
            case 2:
                add(Op::OpCompositeExtract, scalar,
                    {a, static_cast<std::uint32_t>(random_->below(static_cast<int>(components)))});
                break;
            default: {
                add(Op::OpVectorShuffle, of_type, {a, other()});
                for (std::uint32_t i = 0; i < components; ++i)
                    made.back().words.push_back(random_->chance(5) ? ~0u
                                                                   : static_cast<std::uint32_t>(random_->below(
                                                                         static_cast<int>(2 * components))));
                break;
            }
        }
    } else if (random_->chance(25)) {
        Id boolean = find_type(Op::OpTypeBool, {});
        if (!boolean) boolean = type_like(Op::OpTypeBool, {});
        if (is_vector) boolean = type_like(Op::OpTypeVector, {boolean, components});
        const Id condition = find_value(boolean, at);
        add(Op::OpSelect, of_type, {condition ? condition : null_of(boolean), a, other()});
    } else if (is_integer(of_type)) {
        const auto& row = equal_signatures()[0];
        if (random_->chance(25)) {
            Id boolean = type_like(Op::OpTypeBool, {});
            if (is_vector) boolean = type_like(Op::OpTypeVector, {boolean, components});
            add(random_->pick(equal_signatures()[2]), boolean, {a, other()});
        } else if (random_->chance(15)) {
            add(random_->pick({Op::OpBitFieldInsert}), of_type, {a, other(), index_value(at, 32), index_value(at, 32)});
        } else if (random_->chance(15)) {
            add(random_->pick({Op::OpBitFieldSExtract, Op::OpBitFieldUExtract}), of_type,
                {a, index_value(at, 32), index_value(at, 32)});
        } else if (random_->chance(15)) {
            add(random_->pick({Op::OpSNegate, Op::OpNot, Op::OpBitReverse, Op::OpBitCount}), of_type, {a});
        } else {
            add(random_->pick(row), of_type, {a, other()});
        }
    } else if (is_floating(of_type)) {
        if (random_->chance(25)) {
            Id boolean = type_like(Op::OpTypeBool, {});
            if (is_vector) boolean = type_like(Op::OpTypeVector, {boolean, components});
            add(random_->pick(equal_signatures()[3]), boolean, {a, other()});
        } else if (is_vector && random_->chance(20)) {
            add(Op::OpDot, scalar, {a, other()});
        } else if (random_->chance(25)) {
            Id number = type_like(Op::OpTypeInt, {32u, static_cast<std::uint32_t>(random_->below(2))});
            if (is_vector) number = type_like(Op::OpTypeVector, {number, components});
            add(random_->pick({Op::OpConvertFToS, Op::OpConvertFToU, Op::OpBitcast}), number, {a});
        } else {
            add(random_->pick(equal_signatures()[1]), of_type, {a, other()});
        }
    } else if (is_numeric(of_type, Op::OpTypeBool)) {
        add(random_->pick(equal_signatures()[4]), of_type, {a, other()});
    } else {
        add(random_->pick({Op::OpCopyObject, Op::OpFNegate, Op::OpTranspose}), of_type, {a});
    }
    const Id result = made.back().result;
    const std::size_t count = made.size();
    insert(at, std::move(made));
    use_later(result, at + count);
    return true;
}

bool MutableModule::insert_access() {
    const auto label = find_block(true);
    if (!label) return false;
    const auto [first, last] = insertion_range(*label);
    const std::size_t at = first + static_cast<std::size_t>(random_->below(static_cast<int>(last - first + 1)));
    const auto is_pointer = [&](Id id) {
        const Instruction* kind = type(id);
        if (kind->op != Op::OpTypePointer) return false;
        const Instruction* pointee = type(kind->words[3]);
        return pointee && (pointee->op == Op::OpTypeStruct || pointee->op == Op::OpTypeArray ||
                           pointee->op == Op::OpTypeRuntimeArray || pointee->op == Op::OpTypeVector ||
                           pointee->op == Op::OpTypeMatrix);
    };
    const Id base = find_value(is_pointer, at);
    if (!base) return false;
    const std::uint32_t storage = type(type_of(base))->words[2];
    Id pointee = type(type_of(base))->words[3];
    Instruction chain = make(random_->chance(50) ? Op::OpAccessChain : Op::OpInBoundsAccessChain, 0, 0, {});
    std::vector<std::uint32_t> indices;
    while (indices.size() < 8) {
        const Instruction* kind = type(pointee);
        if (!kind) return false;
        if (kind->op == Op::OpTypeStruct) {
            if (kind->words.size() < 3) return false;
            const auto member = static_cast<std::uint32_t>(random_->below(static_cast<int>(kind->words.size() - 2)));
            indices.push_back(constant(type_like(Op::OpTypeInt, {32u, 0u}), member));
            pointee = kind->words[2 + member];
        } else if (kind->op == Op::OpTypeArray || kind->op == Op::OpTypeRuntimeArray || kind->op == Op::OpTypeVector ||
                   kind->op == Op::OpTypeMatrix) {
            const std::uint32_t count =
                kind->op == Op::OpTypeVector || kind->op == Op::OpTypeMatrix ? kind->words[3] : 8;
            indices.push_back(index_value(at, count));
            pointee = kind->words[2];
        } else {
            break;
        }
        if (is_plain(pointee) && random_->chance(20)) break;
    }
    const Id pointer = type_like(Op::OpTypePointer, {storage, pointee});
    chain.type = pointer, chain.result = fresh();
    chain.words = {0, chain.type, chain.result, base};
    chain.words.insert(chain.words.end(), indices.begin(), indices.end());
    const Id place = chain.result;
    std::vector<Instruction> made{std::move(chain)};
    Id result = 0;
    if (random_->chance(45)) {
        Id stored = find_value(pointee, at);
        if (!stored) stored = interesting_constant(pointee);
        if (!stored) return false;
        made.push_back(make(Op::OpStore, 0, 0, {place, stored}));
    } else if (is_integer(pointee) && random_->chance(20)) {
        const Id word = type_like(Op::OpTypeInt, {32u, 0u});
        const Id scope = constant(word, 1), semantics = constant(word, 0);
        Id value = find_value(pointee, at);
        if (!value) value = interesting_constant(pointee);
        result = fresh();
        made.push_back(make(random_->pick(equal_signatures()[14]), pointee, result, {place, scope, semantics, value}));
    } else {
        result = fresh();
        made.push_back(make(Op::OpLoad, pointee, result, {place}));
        // What is loaded goes somewhere, so that it is not left out.
        const Id target =
            find_value([&](Id id) { return type(id)->op == Op::OpTypePointer && type(id)->words[3] == pointee; }, at);
        if (target && random_->chance(50)) made.push_back(make(Op::OpStore, 0, 0, {target, result}));
    }
    const std::size_t count = made.size();
    insert(at, std::move(made));
    if (result) use_later(result, at + count);
    return true;
}

bool MutableModule::insert_selection() {
    const auto label = find_block(false);
    if (!label) return false;
    const auto [first, last] = insertion_range(*label);
    const std::size_t at = first + static_cast<std::size_t>(random_->below(static_cast<int>(last - first + 1)));
    const std::size_t end = std::min(last, at + static_cast<std::size_t>(random_->below(8)));
    const Id boolean = type_like(Op::OpTypeBool, {});
    Id condition = find_value(boolean, at);
    std::vector<Instruction> made;
    if (!condition || random_->chance(30)) {
        const Id number = find_value([&](Id id) { return type(id)->op == Op::OpTypeInt; }, at);
        if (number) {
            condition = fresh();
            made.push_back(make(random_->pick(equal_signatures()[2]), boolean, condition,
                                {number, interesting_constant(type_of(number))}));
        }
    }
    if (!condition) condition = interesting_constant(boolean);
    const Id then = fresh(), behind = fresh(), block = instructions_[*label].result;
    rename_predecessor(block, behind, *label);
    bool moves = random_->chance(50);
    for (std::size_t i = at; i < end; ++i)
        if (instructions_[i].result && !is_plain(instructions_[i].type)) moves = false;
    made.push_back(make(Op::OpSelectionMerge, 0, 0, {behind, 0}));
    made.push_back(make(Op::OpBranchConditional, 0, 0, {condition, then, behind}));
    made.push_back(make(Op::OpLabel, 0, then, {}));
    std::unordered_map<Id, Id> renamed;
    std::vector<Instruction> copies = cloned(at, end, renamed);
    made.insert(made.end(), copies.begin(), copies.end());
    made.push_back(make(Op::OpBranch, 0, 0, {behind}));
    made.push_back(make(Op::OpLabel, 0, behind, {}));
    if (moves) {
        for (std::size_t i = at; i < end; ++i)
            if (const Id result = instructions_[i].result; result && renamed.contains(result))
                made.push_back(make(Op::OpPhi, instructions_[i].type, result,
                                    {renamed[result], then, null_of(instructions_[i].type), block}));
        instructions_.erase(instructions_.begin() + static_cast<std::ptrdiff_t>(at),
                            instructions_.begin() + static_cast<std::ptrdiff_t>(end));
    }
    insert(at, std::move(made));
    return true;
}

bool MutableModule::insert_switch() {
    const auto label = find_block(false);
    if (!label) return false;
    const auto [first, last] = insertion_range(*label);
    const std::size_t at = first + static_cast<std::size_t>(random_->below(static_cast<int>(last - first + 1)));
    const Id selector =
        find_value([&](Id id) { return type(id)->op == Op::OpTypeInt && type(id)->words[2] == 32; }, at);
    if (!selector) return false;
    const Id behind = fresh(), block = instructions_[*label].result;
    rename_predecessor(block, behind, *label);
    std::vector<Id> cases;
    for (int i = random_->between(1, 6); i > 0; --i) cases.push_back(fresh());
    std::vector<Instruction> made{make(Op::OpSelectionMerge, 0, 0, {behind, 0})};
    Instruction branch = make(Op::OpSwitch, 0, 0, {selector, random_->chance(50) ? behind : random_->pick(cases)});
    for (std::size_t i = 0; i < cases.size(); ++i) {
        branch.words.insert(branch.words.end(), {static_cast<std::uint32_t>(i), cases[i]});
        if (random_->chance(20))
            branch.words.insert(branch.words.end(), {static_cast<std::uint32_t>(i) + 100, cases[i]});
    }
    made.push_back(std::move(branch));
    for (std::size_t i = 0; i < cases.size(); ++i) {
        made.push_back(make(Op::OpLabel, 0, cases[i], {}));
        std::unordered_map<Id, Id> renamed;
        const std::size_t begin = std::min(last, at + static_cast<std::size_t>(random_->below(6)));
        // What is copied comes before it is made: everything from the place on.
        std::vector<Instruction> copies =
            cloned(at, std::min(last, begin + static_cast<std::size_t>(random_->below(4))), renamed);
        made.insert(made.end(), copies.begin(), copies.end());
        const bool falls_through = i + 1 < cases.size() && random_->chance(50);
        made.push_back(make(Op::OpBranch, 0, 0, {falls_through ? cases[i + 1] : behind}));
    }
    made.push_back(make(Op::OpLabel, 0, behind, {}));
    insert(at, std::move(made));
    return true;
}

bool MutableModule::insert_loop() {
    const auto label = find_block(false);
    if (!label) return false;
    const auto [first, last] = insertion_range(*label);
    const std::size_t at = first + static_cast<std::size_t>(random_->below(static_cast<int>(last - first + 1)));
    const std::size_t end = std::min(last, at + static_cast<std::size_t>(random_->below(10)));
    Id number = find_type(Op::OpTypeInt, {32u, 0u});
    if (!number) number = type_like(Op::OpTypeInt, {32u, 1u});
    const Id boolean = type_like(Op::OpTypeBool, {});
    const Id header = fresh(), body = fresh(), next = fresh(), behind = fresh(), block = instructions_[*label].result;
    const Id counter = fresh(), increased = fresh();
    // Each invocation may leave in another iteration; seldom after billions of them.
    std::vector<Instruction> counted;
    Id limit = random_->chance(45) ? find_value(number, at) : 0;
    if (limit && random_->chance(95)) {
        counted.push_back(make(Op::OpBitwiseAnd, number, fresh(), {limit, constant(number, 7)}));
        limit = counted.back().result;
    }
    if (!limit) limit = constant(number, static_cast<std::uint32_t>(random_->between(1, 5)));
    // Now and then a loop that may have no end.
    Id condition = random_->chance(2) ? find_value(boolean, at) : 0;
    rename_predecessor(block, behind, *label);
    std::unordered_map<Id, Id> renamed;
    std::vector<Instruction> copies = cloned(at, end, renamed);
    std::vector<Instruction> made = std::move(counted);
    made.push_back(make(Op::OpBranch, 0, 0, {header}));
    made.push_back(make(Op::OpLabel, 0, header, {}));
    made.push_back(make(Op::OpPhi, number, counter, {constant(number, 0), block, increased, next}));
    const std::size_t phis = made.size();
    // One value goes from one iteration to the next.
    for (Instruction& copy : copies) {
        if (!copy.result || !is_plain(copy.type)) continue;
        for (const Operand& operand : copy.operands) {
            const Id from = copy.words[operand.first];
            if (!is_id(operand.kind) || type_of(from) != copy.type) continue;
            const Id carried = fresh();
            copy.words[operand.first] = carried;
            made.push_back(make(Op::OpPhi, copy.type, carried, {from, block, copy.result, next}));
            break;
        }
        if (made.size() > phis) break;
    }
    made.push_back(make(Op::OpLoopMerge, 0, 0, {behind, next, 0}));
    made.push_back(make(Op::OpBranch, 0, 0, {body}));
    made.push_back(make(Op::OpLabel, 0, body, {}));
    made.insert(made.end(), copies.begin(), copies.end());
    if (!condition) {
        condition = fresh();
        made.push_back(make(random_->pick({Op::OpULessThan, Op::OpSLessThan, Op::OpINotEqual}), boolean, condition,
                            {counter, limit}));
    }
    const bool is_swapped = random_->chance(3);
    made.push_back(
        make(Op::OpBranchConditional, 0, 0, {condition, is_swapped ? behind : next, is_swapped ? next : behind}));
    made.push_back(make(Op::OpLabel, 0, next, {}));
    made.push_back(make(Op::OpIAdd, number, increased, {counter, constant(number, 1)}));
    made.push_back(make(Op::OpBranch, 0, 0, {header}));
    made.push_back(make(Op::OpLabel, 0, behind, {}));
    insert(at, std::move(made));
    return true;
}

/// A conditional way out: of the function, of a loop around, to its next iteration.
bool MutableModule::insert_jump() {
    const auto label = find_block(false);
    if (!label) return false;
    const auto [first, last] = insertion_range(*label);
    const std::size_t at = first + static_cast<std::size_t>(random_->below(static_cast<int>(last - first + 1)));
    const Id boolean = type_like(Op::OpTypeBool, {});
    Id condition = find_value(boolean, at);
    if (!condition) condition = interesting_constant(boolean);
    const std::size_t begin = function_begin(at);
    std::vector<Id> targets;
    for (std::size_t i = begin; i < at; ++i)
        if (instructions_[i].op == Op::OpLoopMerge)
            targets.insert(targets.end(), {instructions_[i].words[1], instructions_[i].words[2]});
    const Id leaves = fresh(), behind = fresh(), block = instructions_[*label].result;
    rename_predecessor(block, behind, *label);
    std::vector<Instruction> made{make(Op::OpSelectionMerge, 0, 0, {behind, 0}),
                                  make(Op::OpBranchConditional, 0, 0, {condition, leaves, behind}),
                                  make(Op::OpLabel, 0, leaves, {})};
    if (!targets.empty() && random_->chance(75)) {
        made.push_back(make(Op::OpBranch, 0, 0, {random_->pick(targets)}));
    } else {
        const Id result = instructions_[begin].type;
        if (random_->chance(15)) made.push_back(make(random_->pick({Op::OpKill, Op::OpUnreachable}), 0, 0, {}));
        else if (type(result) && type(result)->op == Op::OpTypeVoid) made.push_back(make(Op::OpReturn, 0, 0, {}));
        else if (const Id value = interesting_constant(result)) made.push_back(make(Op::OpReturnValue, 0, 0, {value}));
        else return false;
    }
    made.push_back(make(Op::OpLabel, 0, behind, {}));
    insert(at, std::move(made));
    return true;
}

/// An instruction becomes a call of a function that does it.
bool MutableModule::wrap_in_function() {
    const auto position = find_instruction([&](const Instruction& at) {
        return !is_structural(at.op) && at.result && is_plain(at.type) && at.op != Op::OpFunctionCall;
    });
    if (!position) return false;
    Instruction inner = instructions_[*position];
    Instruction call = make(Op::OpFunctionCall, inner.type, inner.result, {});
    const Id function = fresh();
    call.words.push_back(function);
    Instruction signature = make(Op::OpTypeFunction, 0, 0, {});
    signature.words = {0, 0, inner.type};
    std::vector<Instruction> parameters;
    for (const Operand& operand : inner.operands) {
        const Id from = inner.words[operand.first];
        if (!is_id(operand.kind) || !type_of(from) || (definition(from) && is_constant(definition(from)->op))) continue;
        // Global variables are seen in the function as well, others come as pointers.
        if (definitions_[from] < first_function_) continue;
        const Id parameter = fresh();
        parameters.push_back(make(Op::OpFunctionParameter, type_of(from), parameter, {}));
        signature.words.push_back(type_of(from));
        call.words.push_back(from);
        inner.words[operand.first] = parameter;
    }
    Id function_type = 0;
    for (std::size_t i = first_type_; i < first_function_; ++i)
        if (instructions_[i].op == Op::OpTypeFunction && instructions_[i].words.size() == signature.words.size() &&
            std::equal(signature.words.begin() + 2, signature.words.end(), instructions_[i].words.begin() + 2))
            function_type = instructions_[i].result;
    if (!function_type) {
        function_type = signature.result = fresh();
        signature.words[1] = function_type;
        globals_.push_back(std::move(signature));
    }
    inner.result = fresh();
    inner.words[2] = inner.result;
    const auto control = random_->pick({0u, 0u, 1u, 2u, 8u});
    const Id result = inner.result;
    functions_.push_back(make(Op::OpFunction, inner.type, function, {control, function_type}));
    functions_.insert(functions_.end(), parameters.begin(), parameters.end());
    functions_.push_back(make(Op::OpLabel, 0, fresh(), {}));
    const Id of_type = inner.type;
    functions_.push_back(std::move(inner));
    // Sometimes there is a way through the function on which it returns something else.
    if (random_->chance(30)) {
        const Id early = fresh(), late = fresh(), boolean = type_like(Op::OpTypeBool, {});
        functions_.push_back(make(Op::OpSelectionMerge, 0, 0, {late, 0}));
        functions_.push_back(make(Op::OpBranchConditional, 0, 0, {interesting_constant(boolean), early, late}));
        functions_.push_back(make(Op::OpLabel, 0, early, {}));
        functions_.push_back(make(Op::OpReturnValue, 0, 0, {null_of(of_type)}));
        functions_.push_back(make(Op::OpLabel, 0, late, {}));
    }
    functions_.push_back(make(Op::OpReturnValue, 0, 0, {result}));
    functions_.push_back(make(Op::OpFunctionEnd, 0, 0, {}));
    instructions_[*position] = std::move(call);
    return true;
}

bool MutableModule::add_decoration() {
    const auto position =
        find_instruction([](const Instruction& at) { return at.result && at.type && at.op != Op::OpFunction; });
    if (!position) return false;
    Id target = instructions_[*position].result;
    if (random_->chance(40)) {
        std::vector<Id> variables;
        for (std::size_t i = first_type_; i < first_function_; ++i)
            if (instructions_[i].op == Op::OpVariable) variables.push_back(instructions_[i].result);
        if (!variables.empty()) target = random_->pick(variables);
    }
    // RelaxedPrecision, NoPerspective, Flat, Centroid, Sample, Invariant, Restrict, Aliased, Volatile, Coherent,
    // NonWritable, NonReadable, NoContraction, NonUniform.
    annotations_.push_back(
        make(Op::OpDecorate, 0, 0,
             {target, random_->pick({0u, 13u, 14u, 16u, 17u, 18u, 19u, 20u, 21u, 23u, 24u, 25u, 42u, 5300u})}));
    return true;
}

bool MutableModule::mutate(Random& random) {
    random_ = &random;
    if (first_function_ >= instructions_.size()) return change_literal();
    using Change = bool (MutableModule::*)();
    static const std::vector<std::pair<int, Change>> changes{
        {22, &MutableModule::replace_operand},    {5, &MutableModule::change_constant},
        {2, &MutableModule::change_array_length}, {8, &MutableModule::change_opcode},
        {4, &MutableModule::change_extended},     {6, &MutableModule::change_literal},
        {6, &MutableModule::change_index},        {5, &MutableModule::change_terminator},
        {5, &MutableModule::remove_instruction},  {4, &MutableModule::duplicate_instruction},
        {4, &MutableModule::swap_instructions},   {12, &MutableModule::insert_operation},
        {10, &MutableModule::insert_access},      {7, &MutableModule::insert_selection},
        {4, &MutableModule::insert_switch},       {6, &MutableModule::insert_loop},
        {5, &MutableModule::insert_jump},         {4, &MutableModule::wrap_in_function},
        {3, &MutableModule::add_decoration}};
    int total = 0;
    for (const auto& [weight, change] : changes) total += weight;
    int drawn = random.below(total);
    for (const auto& [weight, change] : changes) {
        drawn -= weight;
        if (drawn < 0) return (this->*change)();
    }
    return false;
}

}  // namespace nacre::hostile
