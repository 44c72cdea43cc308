// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <llvm/IR/Constants.h>

#include <bit>

#include "backends/cpu/compiler/emitter.h"
#include "backends/cpu/image_view.h"

namespace nacre::cpu {

using spv::Op;

namespace {

constexpr const char* function_symbol = "nacre_cpu_image";

/// Operands of an image instruction that its mask announces, in the order of their bits.
struct ImageOperands {
    Id bias = 0, lod = 0, gradient_x = 0, gradient_y = 0, offset = 0, offsets = 0, sample = 0, min_lod = 0;
};

ImageOperands operands_from(const Instruction& at, std::size_t first) {
    ImageOperands found;
    if (first >= at.operands.size()) return found;
    const std::uint32_t bits = at.operand(first);
    std::size_t next = first + 1;
    const auto has = [&](spv::ImageOperandsShift shift) { return (bits >> static_cast<unsigned>(shift)) & 1; };
    if (has(spv::ImageOperandsShift::Bias)) found.bias = at.operand(next++);
    if (has(spv::ImageOperandsShift::Lod)) found.lod = at.operand(next++);
    if (has(spv::ImageOperandsShift::Grad))
        found.gradient_x = at.operand(next), found.gradient_y = at.operand(next + 1), next += 2;
    if (has(spv::ImageOperandsShift::ConstOffset)) found.offset = at.operand(next++);
    if (has(spv::ImageOperandsShift::Offset)) found.offset = at.operand(next++);
    if (has(spv::ImageOperandsShift::ConstOffsets)) found.offsets = at.operand(next++);
    if (has(spv::ImageOperandsShift::Sample)) found.sample = at.operand(next++);
    if (has(spv::ImageOperandsShift::MinLod)) found.min_lod = at.operand(next++);
    return found;
}

}  // namespace

std::uint32_t Emitter::dimensions_of(spv::Dim dim) {
    switch (dim) {
        case spv::Dim::Dim1D:
        case spv::Dim::Buffer: return 1;
        case spv::Dim::Dim3D:
        case spv::Dim::Cube: return 3;
        default: return 2;
    }
}

std::uint32_t Emitter::image_integer_flag(Id image_type) const {
    return module.type(module.type(image_type).element).kind == TypeKind::integer ? std::uint32_t{image_integer} : 0;
}

Component Emitter::from_word(const Component& word, llvm::Type* kind) {
    return apply({word}, [&](auto v) -> llvm::Value* {
        if (kind->isFloatTy()) return builder.CreateBitCast(v[0], like(v[0], kind));
        if (kind->isDoubleTy())
            return builder.CreateFPExt(builder.CreateBitCast(v[0], like(v[0], builder.getFloatTy())), like(v[0], kind));
        if (kind->isHalfTy())
            return math.convert_float(builder.CreateBitCast(v[0], like(v[0], builder.getFloatTy())), kind);
        return builder.CreateZExtOrTrunc(v[0], like(v[0], kind));
    });
}

Component Emitter::to_word(const Component& value) {
    return apply({value}, [&](auto v) -> llvm::Value* {
        llvm::Type* scalar = v[0]->getType()->getScalarType();
        if (scalar->isFloatTy()) return builder.CreateBitCast(v[0], like(v[0], builder.getInt32Ty()));
        if (scalar->isDoubleTy())
            return builder.CreateBitCast(builder.CreateFPTrunc(v[0], like(v[0], builder.getFloatTy())),
                                         like(v[0], builder.getInt32Ty()));
        if (scalar->isHalfTy())
            return builder.CreateBitCast(math.convert_float(v[0], builder.getFloatTy()),
                                         like(v[0], builder.getInt32Ty()));
        return builder.CreateZExtOrTrunc(v[0], like(v[0], builder.getInt32Ty()));
    });
}

void Emitter::put_argument(std::size_t offset, const Component& value) {
    llvm::Value* words = widen(value);
    builder.CreateAlignedStore(words, at_offset(image_memory(), static_cast<std::int64_t>(offset)), llvm::Align(4));
}

llvm::Value* Emitter::image_memory() {
    if (!image_arguments)
        image_arguments = make_slot(llvm::ArrayType::get(builder.getInt8Ty(), sizeof(ImageArguments)), "image");
    return image_arguments;
}

void Emitter::set_image_atomic(AtomicOperation operation, const Component& comparator) {
    builder.CreateStore(int32(static_cast<std::int32_t>(operation)),
                        at_offset(image_memory(), offsetof(ImageArguments, atomic)));
    if (comparator) put_argument(offsetof(ImageArguments, comparator), to_word(comparator));
}

std::vector<Component> Emitter::image_call(const Component& image, const Component& sampler, Id image_type,
                                           const std::vector<Component>& coordinates, std::uint32_t flags,
                                           const std::vector<Component>& texel, const Component& sample) {
    const Type& type = module.type(image_type);
    const auto operation = static_cast<ImageOperation>(flags & image_operation_mask);
    const bool writes = operation == ImageOperation::store || operation == ImageOperation::atomic;
    if (writes) has_side_effects = true;
    const std::uint32_t count = dimensions_of(type.dim) + (type.arrayed ? 1 : 0);
    for (std::uint32_t i = 0; i < count && i < coordinates.size(); ++i)
        put_argument(offsetof(ImageArguments, coordinates) + i * max_lanes * 4, to_word(coordinates[i]));
    for (std::size_t i = 0; i < texel.size() && i < 4; ++i)
        put_argument(offsetof(ImageArguments, texel) + i * max_lanes * 4, to_word(texel[i]));
    if (sample)
        put_argument(offsetof(ImageArguments, sample), sample);
    else if (type.multisampled)
        put_argument(offsetof(ImageArguments, sample), int32(0));
    llvm::FunctionCallee function =
        external(function_symbol, builder.getVoidTy(),
                 {pointer_type, pointer_type, pointer_type, builder.getInt32Ty(), builder.getInt32Ty()});
    // It comes back, so that what is the same for all batches behind it may be computed in front of their loop.
    for (const auto attribute : {llvm::Attribute::NoUnwind, llvm::Attribute::WillReturn, llvm::Attribute::NoFree})
        llvm::cast<llvm::Function>(function.getCallee())->addFnAttr(attribute);
    llvm::Value* lanes_on = writes ? effect_mask() : mask;
    const std::size_t results = operation == ImageOperation::store ? 0 : 4;
    const bool is_split = !image.is_uniform() || (sampler && !sampler.is_uniform());
    std::vector<llvm::AllocaInst*> gathered;
    if (is_split)
        for (std::size_t i = 0; i < results; ++i) {
            gathered.push_back(make_slot(vector_of(builder.getInt32Ty()), "texel"));
            builder.CreateStore(llvm::Constant::getNullValue(vector_of(builder.getInt32Ty())), gathered.back());
        }
    std::vector<Component> values;
    std::vector<llvm::Value*> read_undefined;
    for_each_different(image, lanes_on, [&](llvm::Value* one_image, llvm::Value* image_mask) {
        for_each_different(
            sampler ? sampler : Component(one_image), image_mask,
            [&](llvm::Value* one_sampler, llvm::Value* both_mask) {
                llvm::Value* view = invariant_load(pointer_type, at_offset(one_image, offsetof(Descriptor, image)), 8);
                llvm::Value* state =
                    sampler ? invariant_load(pointer_type, at_offset(one_sampler, offsetof(Descriptor, sampler)), 8)
                            : llvm::ConstantPointerNull::get(pointer_type);
                llvm::Value* undefined =
                    options.checks ? check_image(one_image, one_sampler, flags, both_mask) : nullptr;
                if (undefined) read_undefined.push_back(undefined);
                builder.CreateCall(function, {view, state, image_memory(), int32(static_cast<std::int32_t>(flags)),
                                              mask_bits(both_mask)});
                for (std::size_t i = 0; i < results; ++i) {
                    llvm::Value* words = builder.CreateAlignedLoad(
                        vector_of(builder.getInt32Ty()),
                        at_offset(image_memory(),
                                  static_cast<std::int64_t>(offsetof(ImageArguments, result) + i * max_lanes * 4)),
                        llvm::Align(64));
                    if (is_split) {
                        // Lanes that are not live come back as zero.
                        llvm::Value* before = builder.CreateLoad(vector_of(builder.getInt32Ty()), gathered[i]);
                        builder.CreateStore(builder.CreateOr(before, words), gathered[i]);
                    } else {
                        values.emplace_back(words);
                    }
                }
            });
    });
    if (is_split)
        for (llvm::AllocaInst* slot : gathered)
            values.emplace_back(builder.CreateLoad(vector_of(builder.getInt32Ty()), slot));
    else if (!read_undefined.empty())
        for (Component& value : values) value.undefined = read_undefined.front();
    return values;
}

llvm::Value* Emitter::bound_view(llvm::Value* descriptor_address) {
    llvm::Value* view = invariant_load(pointer_type, at_offset(descriptor_address, offsetof(Descriptor, image)), 8);
    // Nothing bound: the zeros of a view of nothing.
    auto*& empty = shared_["empty_view"];
    if (!empty) {
        auto* bytes = llvm::ArrayType::get(builder.getInt64Ty(), (sizeof(ImageView) + 7) / 8);
        empty = new llvm::GlobalVariable(target, bytes, true, llvm::GlobalValue::InternalLinkage,
                                         llvm::Constant::getNullValue(bytes), "no_view");
    }
    return select(builder.CreateICmpNE(view, llvm::ConstantPointerNull::get(pointer_type)), view, empty);
}

bool Emitter::emit_image(const Instruction& at) {
    const auto make_texel = [&](const std::vector<Component>& words, Id type_id) {
        const Type& type = module.type(type_id);
        std::vector<Component> texel;
        llvm::Type* kind = scalar_type(module.type(component_type(type_id, 0)));
        for (std::uint32_t i = 0; i < type.components; ++i) texel.push_back(from_word(words.at(i), kind));
        return texel;
    };
    switch (at.op) {
        case Op::OpSampledImage: {
            const Value image = get(at.operand(0)), sampler = get(at.operand(1));
            Value& value = define(at.result);
            value.image = image.image, value.sampler = sampler.sampler, value.image_type = image.image_type;
            value.image_root = image.image_root;
            finish_definition(at.result);
            return true;
        }
        case Op::OpImage: {
            const Value from = get(at.operand(0));
            define(at.result) = from;
            finish_definition(at.result);
            return true;
        }
        case Op::OpImageTexelPointer: {
            const Pointer image = get_pointer(at.operand(0));
            auto made = std::make_shared<Pointer>();
            made->kind = Pointer::Kind::texel;
            made->storage = spv::StorageClass::Image;
            made->image_descriptor = descriptor(image);
            made->root = image.root;
            made->image_type = image.type;
            made->coordinates = get(at.operand(1)).components;
            made->sample = get_scalar(at.operand(2));
            made->type = module.type(at.type).element;
            define(at.result).pointer = std::move(made);
            finish_definition(at.result);
            return true;
        }
        case Op::OpImageQuerySize:
        case Op::OpImageQuerySizeLod:
        case Op::OpImageQueryLevels:
        case Op::OpImageQuerySamples: return emit_image_query(at);
        default: break;
    }

    bool is_projected = false, is_compared = false, is_implicit = false;
    ImageOperation operation = ImageOperation::sample;
    std::size_t first_operand = 2;
    switch (at.op) {
        case Op::OpImageSampleImplicitLod: is_implicit = true; break;
        case Op::OpImageSampleExplicitLod: break;
        case Op::OpImageSampleDrefImplicitLod: is_implicit = is_compared = true; break;
        case Op::OpImageSampleDrefExplicitLod: is_compared = true; break;
        case Op::OpImageSampleProjImplicitLod: is_implicit = is_projected = true; break;
        case Op::OpImageSampleProjExplicitLod: is_projected = true; break;
        case Op::OpImageSampleProjDrefImplicitLod: is_implicit = is_projected = is_compared = true; break;
        case Op::OpImageSampleProjDrefExplicitLod: is_projected = is_compared = true; break;
        case Op::OpImageGather: operation = ImageOperation::gather, first_operand = 3; break;
        case Op::OpImageDrefGather: operation = ImageOperation::gather, is_compared = true; break;
        case Op::OpImageFetch: operation = ImageOperation::fetch; break;
        case Op::OpImageRead: operation = ImageOperation::load; break;
        case Op::OpImageWrite: operation = ImageOperation::store, first_operand = 3; break;
        case Op::OpImageQueryLod: operation = ImageOperation::query_lod; break;
        default: return false;
    }
    if (is_compared) first_operand = 3;
    const Value image = get(at.operand(0));
    image_root = image.image_root;
    const Type& type = module.type(image.image_type);
    if (type.dim == spv::Dim::SubpassData) reject("subpass inputs are not supported");
    std::vector<Component> coordinates = get(at.operand(1)).components;
    if (operation == ImageOperation::store && trace_table) {
        trace(at, 0, {at.operand(2)}, get(at.operand(2)).components);
        // Which invocation wrote a texel is asked of textures alone.
        if (type.dim != spv::Dim::Buffer) trace_image_write(coordinates);
    }
    if (in_double() && image_integer_flag(image.image_type) == 0) {
        emit_double_image(at, {operation, is_projected, is_compared, is_implicit, first_operand});
        return true;
    }
    const std::uint32_t dimensions = dimensions_of(type.dim);
    const ImageOperands more = operands_from(at, first_operand);
    std::uint32_t flags = static_cast<std::uint32_t>(operation) | image_integer_flag(image.image_type);
    // Only fragment shaders have neighbors to take differences from; elsewhere the base level is read.
    const bool has_quads = module.model == spv::ExecutionModel::Fragment;
    const auto to_float = [&](const Component& value) {
        return apply({value}, [&](auto v) {
            return v[0]->getType()->getScalarType()->isFloatTy() ? v[0]
                                                                 : math.convert_float(v[0], builder.getFloatTy());
        });
    };
    for (Component& coordinate : coordinates)
        if (coordinate.value->getType()->getScalarType()->isFloatingPointTy()) coordinate = to_float(coordinate);
    if (is_projected)
        for (std::uint32_t i = 0; i < dimensions; ++i)
            coordinates[i] = apply({coordinates[i], coordinates.at(dimensions)},
                                   [&](auto v) { return builder.CreateFDiv(v[0], v[1]); });
    const auto put_lod = [&](Id id) { put_argument(offsetof(ImageArguments, lod), to_float(get_scalar(id))); };
    if (operation == ImageOperation::sample || operation == ImageOperation::query_lod) {
        if (more.gradient_x) {
            flags |= image_lod_gradient;
            const Value dx = get(more.gradient_x), dy = get(more.gradient_y);
            for (std::uint32_t i = 0; i < dimensions; ++i) {
                put_argument(offsetof(ImageArguments, gradient_x) + i * max_lanes * 4, to_float(dx.components.at(i)));
                put_argument(offsetof(ImageArguments, gradient_y) + i * max_lanes * 4, to_float(dy.components.at(i)));
            }
        } else if (more.lod) {
            flags |= image_lod_explicit;
            put_lod(more.lod);
        } else if (is_implicit && !has_quads) {
            flags |= image_lod_explicit;
            if (more.bias)
                put_lod(more.bias);
            else
                put_argument(offsetof(ImageArguments, lod), Component(llvm::ConstantFP::get(builder.getFloatTy(), 0)));
        } else {
            flags |= image_lod_implicit;
            if (more.bias)
                put_lod(more.bias);
            else
                put_argument(offsetof(ImageArguments, lod), Component(llvm::ConstantFP::get(builder.getFloatTy(), 0)));
        }
        if (more.min_lod)
            flags |= image_min_lod, put_argument(offsetof(ImageArguments, min_lod), to_float(get_scalar(more.min_lod)));
    }
    Component level = int32(0);
    if (operation == ImageOperation::fetch || operation == ImageOperation::load) {
        if (more.lod) level = get_scalar(more.lod);
        put_argument(offsetof(ImageArguments, lod), level);
    }
    if (is_compared) {
        flags |= image_compare;
        Component reference = to_float(get_scalar(at.operand(2)));
        // The reference is projected like the coordinates (Vulkan specification, "Projection Operation").
        if (is_projected)
            reference = apply({reference, coordinates.at(dimensions)},
                              [&](auto v) { return builder.CreateFDiv(v[0], v[1]); });
        put_argument(offsetof(ImageArguments, reference), reference);
    }
    if (operation == ImageOperation::gather && !is_compared)
        flags |= (module.constant_word(at.operand(2)).value_or(0) & 3) << image_component_shift;
    if (more.offset) {
        flags |= image_offset;
        const Value offset = get(more.offset);
        for (std::size_t i = 0; i < offset.components.size() && i < 3; ++i)
            put_argument(offsetof(ImageArguments, offset) + i * max_lanes * 4, offset.components[i]);
    }
    if (more.offsets) {
        flags |= image_offsets;
        const Value offsets = get(more.offsets);
        for (std::size_t i = 0; i < 8 && i < offsets.components.size(); ++i)
            builder.CreateStore(
                offsets.components[i].value,
                at_offset(image_memory(), static_cast<std::int64_t>(offsetof(ImageArguments, gather_offsets) + i * 4)));
    }
    Component sample;
    if (more.sample) sample = get_scalar(more.sample);
    std::vector<Component> texel;
    if (operation == ImageOperation::store) texel = get(at.operand(2)).components;
    const bool needs_sampler = operation == ImageOperation::sample || operation == ImageOperation::gather ||
                               operation == ImageOperation::query_lod;
    const auto call = [&] {
        return image_call(image.image, needs_sampler ? image.sampler : Component(), image.image_type, coordinates,
                          flags, texel, sample);
    };
    if (is_implicit && has_quads && looks_for(check_sanitize)) check_quads();
    const bool is_texel = operation == ImageOperation::fetch || operation == ImageOperation::load ||
                          operation == ImageOperation::store;
    const bool may_be_direct = !options.checks && is_texel && image.image.is_uniform() && level.is_uniform() &&
                               !more.offset && !type.multisampled && type.dim != spv::Dim::Cube &&
                               level.value->getType()->isIntegerTy(32) &&
                               coordinates.at(0).value->getType()->getScalarType()->isIntegerTy(32);
    if (operation == ImageOperation::store) {
        if (!may_be_direct || !store_directly(image.image, image.image_type, coordinates, texel, [&] { call(); }))
            call();
        return true;
    }
    const bool is_one_texel = operation == ImageOperation::fetch && module.model == spv::ExecutionModel::Fragment &&
                              type.dim != spv::Dim::Buffer &&
                              std::ranges::all_of(coordinates, &Component::is_uniform);
    const std::vector<Component> words =
        !may_be_direct ? call()
        : is_one_texel ? fetch_once(image.image, image.image_type, coordinates, level, flags)
                       : fetch_directly(image.image, image.image_type, coordinates, level, call);
    if (at.result) set(at, make_texel(words, at.type));
    return true;
}

void Emitter::emit_double_image(const Instruction& at, const ImageAccess& access) {
    const Value image = get(at.operand(0));
    const Type& type = module.type(image.image_type);
    const ImageOperands more = operands_from(at, access.first_operand);
    const ImageOperation operation = access.operation;
    llvm::Type* real = builder.getDoubleTy();
    llvm::AllocaInst* memory =
        make_slot(llvm::ArrayType::get(builder.getInt8Ty(), sizeof(DoubleImageArguments)), "image");
    constexpr std::size_t real_row = max_lanes * 8, word_row = max_lanes * 4;
    const auto put = [&](std::size_t offset, const Component& value, llvm::Type* kind) {
        llvm::Value* row = widen(value);
        if (kind->isDoubleTy() && row->getType()->isIntOrIntVectorTy())
            row = builder.CreateSIToFP(row, vector_of(kind));
        if (kind->isIntegerTy()) row = builder.CreateSExtOrTrunc(row, vector_of(kind));
        builder.CreateAlignedStore(row, at_offset(memory, static_cast<std::int64_t>(offset)), llvm::Align(4));
    };
    const auto put_rows = [&](std::size_t offset, Id id, std::size_t most, llvm::Type* kind) {
        const Value value = get(id);
        for (std::size_t i = 0; i < value.components.size() && i < most; ++i)
            put(offset + i * (kind->isDoubleTy() ? real_row : word_row), value.components[i], kind);
    };
    const std::uint32_t dimensions = dimensions_of(type.dim);
    std::uint32_t flags = static_cast<std::uint32_t>(operation);
    const Value coordinates = get(at.operand(1));
    for (std::size_t i = 0; i < coordinates.components.size() && i < 4; ++i) {
        Component coordinate = coordinates.components[i];
        if (access.is_projected && i < dimensions)
            coordinate = apply({coordinate, coordinates.components.at(dimensions)},
                               [&](auto v) { return builder.CreateFDiv(v[0], v[1]); });
        put(offsetof(DoubleImageArguments, coordinates) + i * real_row, coordinate, real);
    }
    if (operation == ImageOperation::sample || operation == ImageOperation::query_lod) {
        // Only fragment shaders have neighbors to take differences from; elsewhere the base level is read.
        const bool has_quads = module.model == spv::ExecutionModel::Fragment;
        if (more.gradient_x) {
            flags |= image_lod_gradient;
            put_rows(offsetof(DoubleImageArguments, gradient_x), more.gradient_x, 3, real);
            put_rows(offsetof(DoubleImageArguments, gradient_y), more.gradient_y, 3, real);
        } else {
            flags |= more.lod || (access.is_implicit && !has_quads) ? image_lod_explicit : image_lod_implicit;
            const Id lod = more.lod ? more.lod : more.bias;
            put(offsetof(DoubleImageArguments, lod), lod ? get_scalar(lod) : Component(llvm::ConstantFP::get(real, 0)),
                real);
        }
        if (more.min_lod) {
            flags |= image_min_lod;
            put(offsetof(DoubleImageArguments, min_lod), get_scalar(more.min_lod), real);
        }
    }
    if (operation == ImageOperation::fetch || operation == ImageOperation::load)
        put(offsetof(DoubleImageArguments, lod), more.lod ? get_scalar(more.lod) : Component(int32(0)), real);
    if (access.is_compared) {
        flags |= image_compare;
        Component reference = get_scalar(at.operand(2));
        if (access.is_projected)
            reference = apply({reference, coordinates.components.at(dimensions)},
                              [&](auto v) { return builder.CreateFDiv(v[0], v[1]); });
        put(offsetof(DoubleImageArguments, reference), reference, real);
    } else if (operation == ImageOperation::gather) {
        flags |= (module.constant_word(at.operand(2)).value_or(0) & 3) << image_component_shift;
    }
    if (more.offset) {
        flags |= image_offset;
        put_rows(offsetof(DoubleImageArguments, offset), more.offset, 3, builder.getInt32Ty());
    }
    if (more.offsets) {
        flags |= image_offsets;
        const Value offsets = get(more.offsets);
        for (std::size_t i = 0; i < 8 && i < offsets.components.size(); ++i)
            builder.CreateStore(
                offsets.components[i].value,
                at_offset(memory, static_cast<std::int64_t>(offsetof(DoubleImageArguments, gather_offsets) + i * 4)));
    }
    if (more.sample || type.multisampled)
        put(offsetof(DoubleImageArguments, sample), more.sample ? get_scalar(more.sample) : Component(int32(0)),
            builder.getInt32Ty());
    const bool is_store = operation == ImageOperation::store;
    if (is_store) {
        has_side_effects = true;
        put_rows(offsetof(DoubleImageArguments, texel), at.operand(2), 4, real);
    }

    llvm::FunctionCallee function =
        external("nacre_cpu_double_image", builder.getVoidTy(),
                 {pointer_type, pointer_type, pointer_type, builder.getInt32Ty(), builder.getInt32Ty()});
    const bool has_sampler = operation == ImageOperation::sample || operation == ImageOperation::gather ||
                             operation == ImageOperation::query_lod;
    const Component sampler = has_sampler ? image.sampler : image.image;
    std::vector<llvm::AllocaInst*> slots_of;
    for (std::size_t i = 0; i < 4 && !is_store; ++i) {
        slots_of.push_back(make_slot(vector_of(real), "texel"));
        builder.CreateStore(llvm::Constant::getNullValue(vector_of(real)), slots_of.back());
    }
    for_each_different(
        image.image, is_store ? effect_mask() : mask, [&](llvm::Value* one_image, llvm::Value* image_mask) {
            for_each_different(sampler, image_mask, [&](llvm::Value* one_sampler, llvm::Value* lanes_on) {
                llvm::Value* view = invariant_load(pointer_type, at_offset(one_image, offsetof(Descriptor, image)), 8);
                llvm::Value* state =
                    has_sampler ? invariant_load(pointer_type, at_offset(one_sampler, offsetof(Descriptor, sampler)), 8)
                                : llvm::ConstantPointerNull::get(pointer_type);
                builder.CreateCall(function,
                                   {view, state, memory, int32(static_cast<std::int32_t>(flags)), mask_bits(lanes_on)});
                for (std::size_t i = 0; i < slots_of.size(); ++i) {
                    llvm::Value* row = builder.CreateAlignedLoad(
                        vector_of(real),
                        at_offset(memory,
                                  static_cast<std::int64_t>(offsetof(DoubleImageArguments, result) + i * real_row)),
                        llvm::Align(64));
                    builder.CreateStore(select(lanes_on, row, builder.CreateLoad(vector_of(real), slots_of[i])),
                                        slots_of[i]);
                }
            });
        });
    if (!at.result) return;
    std::vector<Component> values;
    for (std::uint32_t i = 0; i < module.type(at.type).components; ++i)
        values.emplace_back(builder.CreateLoad(vector_of(real), slots_of.at(i)));
    set(at, std::move(values));
}

bool Emitter::emit_image_query(const Instruction& at) {
    const Value from = get(at.operand(0));
    const Type& type = module.type(from.image_type);
    llvm::Type* word = builder.getInt32Ty();
    // Sizes are read by lane where the image differs from lane to lane.
    const auto read = [&](std::size_t offset, const Component& level) -> Component {
        const auto one = [&](llvm::Value* descriptor_address, llvm::Value* level_number) -> llvm::Value* {
            llvm::Value* view = bound_view(descriptor_address);
            llvm::Value* address = at_offset(view, static_cast<std::int64_t>(offset));
            if (level_number) {
                llvm::Value* mips = invariant_load(word, at_offset(view, offsetof(ImageView, mip_count)), 4);
                llvm::Value* exists = builder.CreateICmpULT(level_number, mips);
                llvm::Value* safe = select(exists, level_number, int32(0));
                address = builder.CreateGEP(
                    builder.getInt8Ty(), address,
                    builder.CreateMul(builder.CreateZExt(safe, builder.getInt64Ty()), int64(sizeof(ImageLevel))));
                return select(exists, invariant_load(word, address, 4), int32(0));
            }
            return invariant_load(word, address, 4);
        };
        if (from.image.is_uniform() && (!level || level.is_uniform()))
            return one(from.image.value, level ? level.value : nullptr);
        llvm::AllocaInst* result = make_slot(vector_of(word), "size");
        builder.CreateStore(llvm::Constant::getNullValue(vector_of(word)), result);
        llvm::Value *images = widen(from.image), *levels = level ? widen(level) : nullptr;
        for_each_lane(mask, [&](llvm::Value* lane) {
            llvm::Value* value = one(builder.CreateExtractElement(images, lane),
                                     levels ? builder.CreateExtractElement(levels, lane) : nullptr);
            builder.CreateStore(builder.CreateInsertElement(builder.CreateLoad(vector_of(word), result), value, lane),
                                result);
        });
        return Component(builder.CreateLoad(vector_of(word), result));
    };
    std::vector<Component> values;
    if (at.op == Op::OpImageQueryLevels) {
        values.push_back(read(offsetof(ImageView, mip_count), {}));
    } else if (at.op == Op::OpImageQuerySamples) {
        values.push_back(read(offsetof(ImageView, samples), {}));
    } else {
        const Component level = at.op == Op::OpImageQuerySizeLod ? get_scalar(at.operand(1)) : Component(int32(0));
        const std::uint32_t dimensions = type.dim == spv::Dim::Cube ? 2 : dimensions_of(type.dim);
        const std::array<std::size_t, 3> offsets{offsetof(ImageLevel, width), offsetof(ImageLevel, height),
                                                 offsetof(ImageLevel, depth)};
        for (std::uint32_t i = 0; i < dimensions; ++i)
            values.push_back(read(offsetof(ImageView, levels) + offsets[i], level));
        if (type.arrayed) {
            Component layers = read(offsetof(ImageView, layer_count), {});
            if (type.dim == spv::Dim::Cube)
                layers = apply({layers}, [&](auto v) {
                    return builder.CreateUDiv(v[0], llvm::ConstantInt::get(v[0]->getType(), 6));
                });
            values.push_back(layers);
        }
    }
    llvm::Type* kind = scalar_type(module.type(component_type(at.type, 0)));
    for (Component& value : values)
        value = apply({value}, [&](auto v) {
            return builder.CreateZExtOrTrunc(
                v[0], like(v[0], kind));
        });
    set(at, std::move(values));
    return true;
}

}  // namespace nacre::cpu
