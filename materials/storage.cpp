// SPDX-License-Identifier: Apache-2.0
#include "materials/storage.h"

#include <algorithm>

namespace nacre::materials {
namespace {

// Bits of a color: 7 each of red and green, 6 of blue, where the eye sees steps least.
constexpr std::uint32_t color_bits = 20;

struct FeatureField {
    std::uint32_t feature;
    const char* name;
    std::uint32_t bits;
};

// Emission is added to the lit color at once and the view-dependent coverage is that of the pixel: neither is stored.
constexpr FeatureField feature_fields[] = {
    {slab_f90, "f90", color_bits},
    {slab_f82, "f82", color_bits},
    {slab_second_lobe, "second roughness", 8},
    {slab_second_lobe, "second weight", 6},
    {slab_fuzz, "fuzz amount", 6},
    {slab_fuzz, "fuzz color", color_bits},
    {slab_fuzz, "fuzz roughness", 6},
    {slab_anisotropy, "anisotropy", 8},
    {slab_thin_film, "film thickness", 10},
    {slab_thin_film, "film ior", 6},
    {slab_specular_lut, "specular table", 8},
    {slab_glints, "glint density", 16},
    {slab_glints, "glint position", 32},
    {slab_glints, "glint derivatives", 64},
};

constexpr std::uint32_t stored_features = [] {
    std::uint32_t result = slab_medium;
    for (const FeatureField& field : feature_fields) result |= field.feature;
    return result;
}();

class Layout {
  public:
    explicit Layout(const FlattenedTree& tree) : tree_(tree), topology_(tree.topology) {}

    StorageLayout run() {
        result_.storage_class = storage_class();
        add("class", 2);
        if (result_.storage_class != StorageClass::simple) {
            add("closures", 3);
            add("frames", 3);
        }
        for (std::uint32_t i = 0; i < topology_.closures.size(); ++i) add_closure(i);
        // The top layer's word has the first normal; a tangent is an angle around it.
        for (std::size_t i = 0; i < topology_.frames.size(); ++i) {
            if (i > 0) add("normal", 22);
            if (needs_tangent(topology_.frames[i])) add("tangent", 10);
        }
        return std::move(result_);
    }

  private:
    StorageClass storage_class() const {
        if ((topology_.features & (slab_glints | slab_specular_lut)) != 0) return StorageClass::special;
        if (topology_.closures.size() > 1 || (topology_.features & slab_anisotropy) != 0) return StorageClass::complex;
        return (topology_.features & stored_features) != 0 ? StorageClass::single : StorageClass::simple;
    }

    bool needs_tangent(std::uint32_t frame) const {
        return std::ranges::any_of(topology_.closures, [&](const TopologyClosure& closure) {
            return closure.frame == frame && (closure.features & slab_anisotropy) != 0;
        });
    }

    // Whether no pixel of the subtree reflects light from its medium.
    bool is_without_diffuse(NodeIndex index) const {
        const Node& node = tree_.visible_tree.nodes[index];
        switch (node.kind) {
            case NodeKind::slab: return node.slab.albedo == glm::vec3(0.0f);
            case NodeKind::coverage: return is_without_diffuse(node.first);
            case NodeKind::mix:
            case NodeKind::layer: return is_without_diffuse(node.first) && is_without_diffuse(node.second);
        }
        return false;
    }

    void add_closure(std::uint32_t index) {
        const TopologyClosure& closure = topology_.closures[index];
        const bool is_single = topology_.closures.size() == 1;
        closure_ = index;
        if (result_.storage_class != StorageClass::simple) {
            add("features", 12);
            add("frame", topology_.frames.size() > 1 ? 2 : 0);
        }
        add("f0", color_bits);
        if (!is_without_diffuse(closure.node)) add("albedo", color_bits);
        // The first closure's roughness lies in the word of the top layer.
        if (!(closure.is_top &&
              std::ranges::find_if(topology_.closures, &TopologyClosure::is_top) - topology_.closures.begin() == index))
            add("roughness", 8);
        for (const FeatureField& field : feature_fields) {
            if ((closure.features & field.feature) != 0) add(field.name, field.bits);
        }
        if ((closure.features & slab_medium) != 0) {
            if (closure.is_bottom) {
                result_.has_subsurface = true;
            } else if (!is_without_diffuse(closure.node)) {
                add("medium transmittance", color_bits);
            }
        }
        // Coverage and mixing weigh all channels alike; only what lies under a layer is tinted. A lone closure's
        // coverage is the pixel's.
        if (closure.is_top) {
            if (!is_single) add("weight", 8);
        } else {
            add("weight", color_bits);
            add("path transmittance", color_bits);
            add("path uncovered", 6);
        }
        closure_ = StorageLayout::no_closure;
    }

    void add(const char* name, std::uint32_t bits) {
        if (bits > 0) result_.fields.push_back({.name = name, .closure = closure_, .bits = bits});
    }

    const FlattenedTree& tree_;
    const Topology& topology_;
    StorageLayout result_;
    std::uint32_t closure_ = StorageLayout::no_closure;
};

}  // namespace

std::string_view name_of(StorageClass storage_class) {
    switch (storage_class) {
        case StorageClass::simple: return "simple";
        case StorageClass::single: return "single";
        case StorageClass::complex: return "complex";
        case StorageClass::special: return "special";
    }
    return "unknown";
}

std::uint32_t StorageLayout::material_words() const {
    std::uint32_t bits = 0;
    for (const StorageField& field : fields) bits += field.bits;
    // Two render targets of material words are always there.
    return std::max((bits + 31) / 32, 2u);
}

StorageLayout storage_layout(const FlattenedTree& tree) { return Layout(tree).run(); }

}  // namespace nacre::materials
