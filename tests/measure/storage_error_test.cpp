// SPDX-License-Identifier: Apache-2.0
#include "measure/storage_error.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "materials/storage.h"
#include "passes/gbuffer_layout.h"

namespace nacre::measure {
namespace {

const std::vector<StorageErrorCurve>& curves() {
    static const std::vector<StorageErrorCurve> all = storage_error_curves(1000);
    return all;
}

// With any number of bits: never above what the codec promises, and no less than a half of it, or the promise says
// nothing.
TEST(StorageError, IsWhatTheBitsSay) {
    for (const StorageErrorCurve& curve : curves()) {
        for (const StorageErrorPoint& point : curve.points) {
            EXPECT_LE(point.largest, point.bound * (1.0 + 1e-9)) << curve.field << " in " << point.bits << " bits";
            EXPECT_GE(point.largest, 0.5 * point.bound) << curve.field << " in " << point.bits << " bits";
            EXPECT_LE(point.rms, point.largest);
            EXPECT_LE(point.dithered_mean, point.dithered_bound + 1e-9)
                << curve.field << " in " << point.bits << " bits";
        }
    }
}

// A bit more halves the error, as soon as there are some; two, of the two coordinates of a direction.
TEST(StorageError, HalvesWithEachBit) {
    for (const StorageErrorCurve& curve : curves()) {
        for (std::size_t i = 1; i < curve.points.size(); ++i) {
            if (curve.points[i].bits < 9 || curve.points[i - 1].bound > 0.1) continue;
            EXPECT_NEAR(curve.points[i].bound / curve.points[i - 1].bound, 0.5, 0.06)
                << curve.field << " in " << curve.points[i].bits << " bits";
        }
    }
}

// No number is stored that has no curve, and none is drawn with other bits than it has.
TEST(StorageError, EachStoredNumberHasACurve) {
    const auto stands = [](std::string_view name, std::string_view where, std::uint32_t bits) {
        return std::ranges::any_of(curves(), [&](const StorageErrorCurve& curve) {
            return curve.field == name && curve.where == where && curve.stored_bits == bits;
        });
    };
    for (const materials::StorageFormat& format : materials::storage_formats()) {
        if (format.codec == materials::StorageCodec::integer) continue;
        if (format.codec == materials::StorageCodec::color) {
            const std::string name = format.name;
            EXPECT_TRUE(stands(name + ", red and green", "closure", 7) && stands(name + ", blue", "closure", 6))
                << name;
            EXPECT_EQ(format.bits, 7u + 7u + 6u);
        } else {
            EXPECT_TRUE(stands(format.name, "closure", format.bits)) << format.name;
        }
    }
    for (const passes::Field& field : passes::gbuffer_fields()) {
        if (field.kind == passes::FieldKind::identifier) continue;
        EXPECT_TRUE(stands(field.name, field.word, field.bits)) << field.name;
    }
    EXPECT_TRUE(stands("mean free path", "subsurface", 8) && stands("thickness", "subsurface", 8));
}

// The curves use the codecs by themselves; the words of subsurface data have their own text.
TEST(StorageError, SubsurfaceDataIsOffByWhatItsCurveSays) {
    const auto find = [](std::string_view name) {
        return std::ranges::find(curves(), name, &StorageErrorCurve::field)->stored();
    };
    for (const double length : {2e-6, 1e-4, 3e-3, 0.7}) {
        materials::closures::Library library;
        auto slab = materials::closures::Library::slab_of(materials::Slab{});
        slab.mean_free_path = glm::dvec3(length);
        slab.thickness = 5.0 * length;
        for (std::uint32_t place = 0; place < 64; ++place) {
            const std::uint32_t word = materials::pack_subsurface(slab, {place % 8, place / 8});
            for (int channel = 0; channel < 3; ++channel)
                EXPECT_LE(std::abs(library.unpack_mean_free_path(word)[channel] / length - 1.0),
                          find("mean free path").bound * 1.0001);
            EXPECT_LE(std::abs(library.unpack_thickness(word) / (5.0 * length) - 1.0),
                      find("thickness").bound * 1.0001);
        }
    }
}

TEST(StorageError, ThePageAndTheJsonHaveEveryField) {
    const std::string json = to_json(curves());
    for (const StorageErrorCurve& curve : curves()) EXPECT_NE(json.find('"' + curve.field + '"'), std::string::npos);
    const ReportPage page = storage_error_page(curves());
    EXPECT_EQ(page.tables[0].rows.size(), curves().size());
    EXPECT_EQ(page.plots.size(), 3u);
}

}  // namespace
}  // namespace nacre::measure
