// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/checks/check_functions.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <optional>

#include "backends/cpu/images/image_operations.h"
#include "rhi/handle.h"

namespace nacre::cpu {
namespace {

using rhi::ShaderFault;

// ---- Words ------------------------------------------------------------------------------------------------------

const char* or_empty(const char* text) { return text ? text : ""; }

/// Which invocation of a workgroup a lane is.
std::uint32_t local_index(const RunningInvocations& running, std::uint32_t lane) {
    return running.subgroup * running.lanes + lane;
}

std::string invocation_text(const RunningInvocations& running, std::uint32_t lane) {
    switch (static_cast<rhi::ShaderStage>(running.stage)) {
        case rhi::ShaderStage::compute: {
            const auto& range = *static_cast<const WorkgroupRange*>(running.work);
            const std::uint32_t local = local_index(running, lane);
            const auto& size = running.size;
            return fmt::format("invocation ({}, {}, {})", running.group_x * size[0] + local % size[0],
                               range.y * size[1] + local / size[0] % size[1],
                               range.z * size[2] + local / size[0] / size[1]);
        }
        case rhi::ShaderStage::vertex: {
            const auto& batch = *static_cast<const VertexBatch*>(running.work);
            return fmt::format("vertex {} of instance {}", static_cast<std::int32_t>(batch.indices[lane]),
                               batch.instance);
        }
        default: {
            const auto& batch = *static_cast<const FragmentBatch*>(running.work);
            return fmt::format("pixel ({}, {})", batch.x[lane / 4] + static_cast<std::int32_t>(lane & 1),
                               batch.y[lane / 4] + static_cast<std::int32_t>(lane >> 1 & 1));
        }
    }
}

/// "'values' (buffer 'result')", as much of it as is known.
std::string object_text(const CheckSite& site, const CheckedMemory* memory) {
    std::string text = site.object ? fmt::format("'{}'", site.object) : std::string();
    if (memory && !memory->name().empty()) text += text.empty() ? memory->name() : fmt::format(" ({})", memory->name());
    if (text.empty() && site.set >= 0) text = fmt::format("set {} binding {}", site.set, site.binding);
    return text;
}

void add_fault(const RunningInvocations& running, const CheckSite& site, ShaderFault kind, std::uint32_t lanes,
               const CheckedMemory* memory, const std::function<std::string(std::uint32_t lane)>& reason,
               const CheckSite* other = nullptr) {
    const CommandChecks& checks = *running.context->checks;
    using enum ShaderFault;
    const bool stops = (checks.flags & check_traps) &&
                       (kind == not_a_number || kind == infinity || kind == division_by_zero || kind == index_range);
    // Of two places that are one fault the first found speaks for both.
    const CheckSite* key = &site;
    std::string object = memory ? memory->name() : std::string();
    if (other) {
        object += fmt::format(" {}", static_cast<const void*>(std::max(key, other)));
        key = std::min(key, other);
    }
    checks.log->add(kind, key, object, static_cast<std::uint32_t>(std::popcount(lanes)), stops, [&] {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
        FoundFault fault;
        fault.subject = fmt::format("'{}'", or_empty(site.shader));
        if (site.place) fault.subject += fmt::format(" ({})", site.place);
        fault.subject += fmt::format(", {}, {}", checks.command, invocation_text(running, lane));
        fault.reason = reason(lane);
        return fault;
    });
    if (stops) std::atomic_ref(checks.state->expired).store(1, std::memory_order_relaxed);
}

const CheckedMemory* object_of(const CommandChecks& checks, const RunningInvocations& running, std::int32_t set,
                               const Descriptor* descriptor) {
    if (set < 0 || set >= static_cast<std::int32_t>(max_groups)) return nullptr;
    const CheckedObjects* objects = checks.objects[static_cast<std::size_t>(set)];
    const Descriptor* first = running.context->groups[set];
    if (!objects || !first || descriptor < first) return nullptr;
    const auto index = static_cast<std::size_t>(descriptor - first);
    return index < objects->size() ? (*objects)[index] : nullptr;
}

// ---- What code calls --------------------------------------------------------------------------------------------

void begin(RunningInvocations* running) {
    running->batch = running->context->checks->batches->fetch_add(1, std::memory_order_relaxed) + 1;
}

CheckedMemory* workgroup_object(const CommandChecks& checks, const std::byte* memory) {
    for (CheckedMemory* candidate : checks.workgroup_memories)
        if (candidate && candidate->data() == memory) return candidate;
    return nullptr;
}

void begin_workgroup(const ShaderContext* context, std::byte* memory, std::uint64_t bytes) {
    const CommandChecks& checks = *context->checks;
    poison(memory, bytes);
    if (CheckedMemory* known = workgroup_object(checks, memory)) known->define(0, bytes, false);
}

void fault(const RunningInvocations* running, const CheckSite* site, std::uint32_t kind_number, std::uint32_t lanes,
           const Descriptor* descriptor, const std::int64_t* found, const std::int64_t* limit) {
    if (lanes == 0) return;
    const auto kind = static_cast<ShaderFault>(kind_number);
    const CheckedMemory* memory =
        descriptor ? object_of(*running->context->checks, *running, site->set, descriptor) : nullptr;
    add_fault(*running, *site, kind, lanes, memory, [&](std::uint32_t lane) -> std::string {
        const std::string object = object_text(*site, memory);
        switch (kind) {
            using enum ShaderFault;
            case not_a_number: return "expected a number, found a NaN that no operand was";
            case infinity: return "expected a finite number, found an infinity that no operand was";
            case division_by_zero: return "expected a divisor other than zero, found zero";
            case index_range:
                return fmt::format("expected an index below {} into {}, found {}", limit ? limit[lane] : 0,
                                   object.empty() ? "an array" : object, found ? found[lane] : 0);
            case uninitialized_read:
                if (running->undefined_site && running->undefined_lanes >> lane & 1)
                    return fmt::format(
                        "expected a value that was written, found one that depends on what was not: {}, read at {}",
                        object_text(*running->undefined_site, running->undefined_memory),
                        running->undefined_site->place ? running->undefined_site->place : "an unknown line");
                return fmt::format("expected a value that was written, found one that depends on what was not{}{}",
                                   object.empty() ? "" : ": ", object);
            case nonuniform_derivative: return "expected all pixels of a quad to run here, found some that do not";
            default: return "";
        }
    });
}

/// The resource of a lane with the offset of an address in it.
struct Accessed {
    CheckedMemory* memory = nullptr;
    std::uint64_t offset = 0;
};

void note_race(const RunningInvocations& running, const CheckSite& site, const Accessed& at, std::uint32_t bytes,
               std::uint32_t access, std::uint32_t lane) {
    const bool is_compute = static_cast<rhi::ShaderStage>(running.stage) == rhi::ShaderStage::compute;
    WordUse use;
    use.batch = running.batch;
    use.site = &site;
    use.scope = running.context->checks->scope;
    use.lane = static_cast<std::uint16_t>(is_compute ? local_index(running, lane) : lane);
    use.barriers = static_cast<std::uint16_t>(running.barriers);
    use.is_atomic = (access & access_atomic) != 0;
    use.is_private = (access & access_workgroup) != 0;
    for (std::uint32_t done = 0; done < bytes;) {
        const std::uint64_t place = at.offset + done;
        const std::uint32_t first = place % 4, count = std::min(4 - first, bytes - done);
        use.bytes = static_cast<std::uint8_t>(((1u << count) - 1) << first);
        if (const auto other = at.memory->note_use(place, (access & access_write) != 0, use)) {
            add_fault(
                running, site, ShaderFault::data_race, 1u << lane, at.memory,
                [&](std::uint32_t) {
                    const std::string object = object_text(site, at.memory);
                    return fmt::format("expected one invocation to use byte {} of {} at a time, found another at {}",
                                       at.offset, object.empty() ? "the workgroup's memory" : object,
                                       other->site && other->site->place ? other->site->place : "an unknown line");
                },
                other->site);
            return;
        }
        done += count;
    }
}

void note_undefined(RunningInvocations& running, const CheckSite& site, const CheckedMemory* memory,
                    std::uint32_t lanes) {
    if (lanes == 0) return;
    running.undefined_site = &site;
    running.undefined_memory = memory;
    running.undefined_lanes = lanes;
}

std::uint32_t memory(RunningInvocations* running, const CheckSite* site, const Descriptor* const* descriptors,
                     std::byte* const* addresses, std::uint32_t bytes, std::uint32_t access, std::uint32_t lanes,
                     std::uint32_t undefined) {
    const CommandChecks& checks = *running->context->checks;
    std::uint32_t read_undefined = 0;
    for (std::uint32_t rest = lanes; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(rest));
        Accessed at;
        if (access & access_workgroup)
            at.memory = workgroup_object(checks, static_cast<const WorkgroupRange*>(running->work)->memory);
        else if (access & access_vertex)
            at.memory = checks.vertex_buffers[static_cast<std::size_t>(site->binding)];
        else
            at.memory = const_cast<CheckedMemory*>(object_of(checks, *running, site->set, descriptors[lane]));
        if (!at.memory) continue;
        const auto offset = at.memory->offset_of(addresses[lane]);
        if (!offset) continue;
        at.offset = *offset;
        if ((access & access_read) && at.memory->is_undefined(at.offset, bytes)) {
            read_undefined |= 1u << lane;
            note_undefined(*running, *site, at.memory, read_undefined);
        }
        if (access & access_shared) note_race(*running, *site, at, bytes, access, lane);
        if (access & access_write) at.memory->define(at.offset, bytes, !(undefined >> lane & 1));
    }
    return read_undefined;
}

void input(RunningInvocations* running, const CheckSite* site, std::uint32_t lanes) {
    note_undefined(*running, *site, nullptr, lanes);
}

// ---- Images -----------------------------------------------------------------------------------------------------

struct TexelPlace {
    std::byte* address = nullptr;
    const char* axis = nullptr;  ///< That is out of range; null: none is.
    std::uint32_t found = 0, limit = 0;
};

TexelPlace find_texel(const ImageView& view, const ImageArguments& arguments, std::uint32_t flags, std::uint32_t lane) {
    const auto operation = static_cast<ImageOperation>(flags & image_operation_mask);
    std::uint32_t mip = 0;
    TexelPlace place;
    const auto check = [&](const char* axis, std::uint32_t found, std::uint32_t limit) {
        if (found >= limit && !place.axis) place.axis = axis, place.found = found, place.limit = limit;
    };
    if (operation == ImageOperation::fetch && view.samples == 1)
        mip = std::bit_cast<std::uint32_t>(arguments.lod[lane]);
    check("mip", mip, view.mip_count);
    if (place.axis) return place;
    const ImageLevel& level = view.levels[mip];
    const auto coordinate = [&](std::uint32_t axis) {
        std::uint32_t value = arguments.coordinates[axis][lane];
        if (flags & image_offset && axis < 3) value += static_cast<std::uint32_t>(arguments.offset[axis][lane]);
        return value;
    };
    std::uint32_t x = coordinate(0), y = 0, slice = 0, sample = 0;
    std::uint64_t slice_stride = 0;
    check("x", x, level.width);
    using enum rhi::ViewDimension;
    if (view.dimension != d1 && view.dimension != d1_array) check("y", y = coordinate(1), level.height);
    if (view.dimension == d3) {
        check("z", slice = coordinate(2), level.depth);
        slice_stride = level.slice_stride;
    } else if (view.dimension != d1 && view.dimension != d2) {
        check("layer", slice = arguments.coordinates[view.dimension == d1_array ? 1 : 2][lane], view.layer_count);
        slice_stride = level.layer_stride;
    }
    if (view.samples > 1) check("sample", sample = static_cast<std::uint32_t>(arguments.sample[lane]), view.samples);
    if (place.axis) return place;
    const std::uint32_t edge = rhi::info(view.format).block_width;
    place.address = level.data + slice * slice_stride + sample * level.sample_stride +
                    std::uint64_t{y / edge} * level.row_stride + std::uint64_t{x / edge} * view.texel_bytes;
    return place;
}

/// Lanes of a filtered read in which an undefined texel has a share.
std::uint32_t sample_undefined(const ImageView& view, CheckedMemory& memory, const Descriptor& sampler,
                               ImageArguments& arguments, std::uint32_t flags, std::uint32_t lanes,
                               std::uint32_t lane_count) {
    if (!sampler.sampler || view.samples > 1) return 0;
    const auto texels = memory.undefined_texels(view);
    if (!texels) return 0;
    SamplerState state = *sampler.sampler;
    state.desc.border = rhi::BorderColor::transparent_black;
    state.desc.comparison = false;
    flags &= ~std::uint32_t{image_compare | image_integer | 3u << image_component_shift};
    image_function(lane_count)(&texels->view, &state, &arguments, flags, lanes);
    std::uint32_t undefined = 0;
    for (std::uint32_t component = 0; component < 4; ++component) {
        // Gathers give four texels; else the others are 0, and alpha is 1.
        if (component != 0 && static_cast<ImageOperation>(flags & image_operation_mask) != ImageOperation::gather)
            break;
        for (std::uint32_t lane = 0; lane < lane_count; ++lane)
            if (std::bit_cast<float>(arguments.result[component][lane]) > 0.0f) undefined |= 1u << lane;
    }
    return undefined & lanes;
}

std::uint32_t image(RunningInvocations* running, const CheckSite* site, const Descriptor* descriptor,
                    const Descriptor* sampler, ImageArguments* arguments, std::uint32_t flags, std::uint32_t lanes) {
    const CommandChecks& checks = *running->context->checks;
    const ImageView* view = descriptor->image;
    const auto operation = static_cast<ImageOperation>(flags & image_operation_mask);
    using enum ImageOperation;
    auto* known = const_cast<CheckedMemory*>(object_of(checks, *running, site->set, descriptor));
    if (!view) return 0;
    if (operation == sample || operation == gather) {
        if (!known || !(checks.flags & (check_sanitize | check_hostile))) return 0;
        const std::uint32_t undefined =
            sample_undefined(*view, *known, *sampler, *arguments, flags, lanes, running->lanes);
        note_undefined(*running, *site, known, undefined);
        return undefined;
    }
    std::uint32_t access = access_read;
    if (operation != fetch) access |= access_shared;
    if (operation == store) access = access_write | access_shared;
    if (operation == atomic) access |= access_write | access_atomic;
    if (flags & image_unshared) access &= ~std::uint32_t{access_shared};
    std::uint32_t read_undefined = 0;
    for (std::uint32_t rest = lanes; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(rest));
        const TexelPlace place = find_texel(*view, *arguments, flags, lane);
        if (place.axis) {
            add_fault(*running, *site, ShaderFault::index_range, 1u << lane, known, [&](std::uint32_t) {
                return fmt::format("expected {} below {} in {}, found {}", place.axis, place.limit,
                                   object_text(*site, known), static_cast<std::int32_t>(place.found));
            });
            continue;
        }
        if (!known || !(checks.flags & (check_sanitize | check_hostile))) continue;
        const auto offset = known->offset_of(place.address);
        if (!offset) continue;
        const Accessed at{known, *offset};
        if ((access & access_read) && known->is_undefined(at.offset, view->texel_bytes)) read_undefined |= 1u << lane;
        // A texel is used whole: its first word stands for it.
        if (access & access_shared) note_race(*running, *site, at, std::min(view->texel_bytes, 4u), access, lane);
        if (access & access_write) known->define(at.offset, view->texel_bytes);
    }
    note_undefined(*running, *site, known, read_undefined);
    return read_undefined;
}

}  // namespace

void check_blend(const CommandChecks* checks, const BlendedTexels& texels) {
    const CommandChecks::Target& target = checks->targets[texels.target];
    if (!target.memory || target.texel_bytes < 4 || !target.memory->has_undefined()) return;
    for (std::uint32_t rest = texels.lanes; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(rest));
        const auto x = static_cast<std::uint32_t>(texels.x[lane / 4]) + (lane & 1),
                   y = static_cast<std::uint32_t>(texels.y[lane / 4]) + (lane >> 1 & 1);
        const auto offset = target.memory->offset_of(
            target.level.data + texels.sample * target.level.sample_stride +
            std::uint64_t{y} * target.level.row_stride + std::uint64_t{x} * target.texel_bytes);
        if (!offset || !target.memory->is_undefined(*offset, target.texel_bytes)) continue;
        // What the pass has written so far is known at its end only: until then by what it is no more.
        bool is_poison = true;
        for (std::uint32_t word = 0; word < target.texel_bytes / 4; ++word)
            is_poison = is_poison && texels.words[word][lane] == poison_word(*offset / 4 + word);
        if (!is_poison) continue;
        const std::string object = checks->command + target.memory->name();
        checks->log->add(ShaderFault::uninitialized_read, nullptr, object, 1, false, [&] {
            FoundFault fault;
            fault.attempted = "blend";
            fault.subject = fmt::format("with {}, {}, pixel ({}, {})", target.memory->name(), checks->command, x, y);
            fault.reason = "expected a texel that was written, found one that was not";
            return fault;
        });
    }
}

NacreCpuCheckBegin check_begin_function() { return begin; }
NacreCpuCheckWorkgroup check_workgroup_function() { return begin_workgroup; }
NacreCpuCheckFault check_fault_function() { return fault; }
NacreCpuCheckMemory check_memory_function() { return memory; }
NacreCpuCheckImage check_image_function() { return image; }
NacreCpuCheckInput check_input_function() { return input; }

std::uint32_t poison_word(std::uint64_t index) {
    // 0x7f8..., 0x7fa...: infinities no, numbers neither; the lower bits differ from word to word.
    const std::uint64_t mixed = (index + 1) * 0x9e3779b97f4a7c15ull;
    return 0x7fa00000u | (static_cast<std::uint32_t>(mixed >> 40) & 0x1fffffu) | 1u;
}

void poison(std::byte* data, std::uint64_t bytes) {
    for (std::uint64_t at = 0; at < bytes; at += 4) {
        const std::uint32_t word = poison_word(at / 4);
        std::memcpy(data + at, &word, std::min<std::uint64_t>(4, bytes - at));
    }
}

}  // namespace nacre::cpu
