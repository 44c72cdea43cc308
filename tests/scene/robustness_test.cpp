// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <ostream>
#include <random>

#include "core/image.h"
#include "tests/scene/gltf_builder.h"
#include "tests/scene/scene_checks.h"

/// @file
/// Every way in which a file can be wrong has an error that names the file and the element, and no way takes much
/// memory or time before it is found.

namespace nacre::scene {
namespace {

using testing::HasSubstr;

struct Fault {
    const char* name;
    std::function<void(GltfBuilder&)> plant;
    std::vector<const char*> message_parts;
    ErrorCode code = ErrorCode::parse;
};

std::ostream& operator<<(std::ostream& out, const Fault& fault) { return out << fault.name; }

class BrokenFile : public testing::TestWithParam<Fault> {};

TEST_P(BrokenFile, IsRefusedWithAnErrorThatNamesTheElement) {
    GltfBuilder file;
    GetParam().plant(file);
    const Expected<Scene> scene = file.load({.time = 0.5f});
    ASSERT_FALSE(scene) << "the file was accepted";
    EXPECT_THAT(scene.error().message(), HasSubstr("'test.gltf'"));
    for (const char* part : GetParam().message_parts) EXPECT_THAT(scene.error().message(), HasSubstr(part));
    EXPECT_EQ(name_of(scene.error().code), name_of(GetParam().code));
    EXPECT_FALSE(scene.error().remedy.empty());
}

void add_picture(GltfBuilder& file, const std::string& uri) {
    file.json["images"] = {{{"uri", uri}, {"name", "paint"}}};
    file.json["textures"] = {{{"source", 0}}};
    file.json["materials"] = {{{"emissiveTexture", {{"index", 0}}}}};
    file.primitive()["material"] = 0;
}

std::string png_text(std::uint32_t side) {
    const auto png = encode_png(
        {.width = side, .height = side, .channels = 1, .bytes = std::vector<std::uint8_t>(std::size_t{side} * side)});
    EXPECT_TRUE(png);
    return {reinterpret_cast<const char*>(png->data()), png->size()};
}

std::string picture_uri(const std::string& content) {
    const auto bytes = as_bytes(content);
    return "data:image/png;base64," + encode_base64({bytes.begin(), bytes.end()});
}

void animate(GltfBuilder& file, const std::vector<float>& times, const std::vector<float>& values) {
    file.json["animations"] = {
        {{"name", "spin"},
         {"samplers",
          {{{"input", file.add_accessor(times, "SCALAR")}, {"output", file.add_accessor(values, "SCALAR")}}}},
         {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
}

const Fault faults[] = {
    // Accessors, views and buffers.
    {"AccessorBeyondItsView",
     [](GltfBuilder& f) { f.json["accessors"][0]["count"] = 4; },
     {"mesh 0 'shape'", "primitive 0", "accessor 0", "4 elements of 12 bytes", "holds 36 bytes", "truncated"}},
    {"AccessorOffsetBeyondItsView", [](GltfBuilder& f) { f.json["accessors"][0]["byteOffset"] = 4; }, {"accessor 0"}},
    {"HugeCount",
     [](GltfBuilder& f) { f.json["accessors"][0]["count"] = 1'000'000'000; },
     {"accessor 0", "1,000,000,000"}},
    {"CountNear2To64",
     [](GltfBuilder& f) { f.json["accessors"][0]["count"] = 18446744073709551615u; },
     {"mesh 0 'shape'"}},
    {"HugeCountWithoutView",
     [](GltfBuilder& f) {
         f.json["accessors"][0].erase("bufferView");
         f.json["accessors"][0]["count"] = 1'000'000'000;
     },
     {"accessor 0", "needs more than"},
     ErrorCode::out_of_memory},
    {"ManyMeshesOverOneAccessorWithoutView",
     [](GltfBuilder& f) {
         f.json["accessors"][0].erase("bufferView");
         f.json["accessors"][0]["count"] = 3'000'000;
         for (int i = 0; i < 100; ++i) f.json["meshes"][0]["primitives"].push_back(f.primitive());
     },
     {"needs more than"},
     ErrorCode::out_of_memory},
    {"ZeroCount", [](GltfBuilder& f) { f.json["accessors"][0]["count"] = 0; }, {"/accessors/0/count", "at least 1"}},
    {"NegativeCount", [](GltfBuilder& f) { f.json["accessors"][0]["count"] = -3; }, {"/accessors/0/count", "-3"}},
    {"FractionalCount", [](GltfBuilder& f) { f.json["accessors"][0]["count"] = 2.5; }, {"/accessors/0/count", "2.5"}},
    {"UnknownComponentType",
     [](GltfBuilder& f) { f.json["accessors"][0]["componentType"] = 5124; },
     {"/accessors/0/componentType", "5124"}},
    {"UnknownType", [](GltfBuilder& f) { f.json["accessors"][0]["type"] = "VEC5"; }, {"/accessors/0/type", "VEC5"}},
    {"WrongTypeForPositions",
     [](GltfBuilder& f) { f.json["accessors"][0]["type"] = "VEC2"; },
     {"mesh 0 'shape'", "expected type VEC3", "VEC2"}},
    {"NormalizedFloats",
     [](GltfBuilder& f) { f.json["accessors"][0]["normalized"] = true; },
     {"accessor 0", "normalized"}},
    {"UnalignedAccessor",
     [](GltfBuilder& f) {
         f.json["accessors"][0]["byteOffset"] = 2;
         f.json["accessors"][0]["count"] = 2;
     },
     {"accessor 0", "not aligned"}},
    {"StrideBelowTheElement",
     [](GltfBuilder& f) { f.json["bufferViews"][0]["byteStride"] = 8; },
     {"accessor 0", "byteStride 8", "12 bytes"}},
    {"StrideOfZero",
     [](GltfBuilder& f) { f.json["bufferViews"][0]["byteStride"] = 0; },
     {"bufferView 0", "byteStride is 0"}},
    {"UnalignedStride",
     [](GltfBuilder& f) { f.json["bufferViews"][0]["byteStride"] = 14; },
     {"bufferView 0", "byteStride is 14"}},
    {"ViewBeyondItsBuffer",
     [](GltfBuilder& f) {
         f.json["bufferViews"][0]["byteLength"] = 81920;
         f.json["bufferViews"][0]["name"] = "wheel data";
     },
     {"bufferView 0 'wheel data'", "81,920", "buffer 0", "holds 36 bytes", "truncated"}},
    {"ViewOffsetNear2To64",
     [](GltfBuilder& f) { f.json["bufferViews"][0]["byteOffset"] = 18446744073709551615u; },
     {"bufferView 0"}},
    {"UnknownBufferView",
     [](GltfBuilder& f) { f.json["accessors"][0]["bufferView"] = 7; },
     {"/accessors/0/bufferView", "bufferView 7", "only 1"}},
    {"UnknownAccessor",
     [](GltfBuilder& f) { f.primitive()["attributes"]["POSITION"] = 9; },
     {"/meshes/0/primitives/0/attributes/POSITION", "accessor 9"}},
    {"BufferShorterThanItSays",
     [](GltfBuilder& f) {
         f.json["buffers"] = {
             {{"byteLength", 100}, {"name", "main"}, {"uri", "data:;base64," + encode_base64(f.data)}}};
     },
     {"buffer 0 'main'", "byteLength is 100", "36 bytes", "truncated"}},
    {"BufferWithoutData",
     [](GltfBuilder& f) {
         f.json["buffers"] = {{{"byteLength", 100}}};
     },
     {"buffer 0", "neither a URI"}},
    {"BadBase64",
     [](GltfBuilder& f) {
         f.json["buffers"] = {{{"byteLength", 3}, {"uri", "data:;base64,AA*A"}}};
     },
     {"buffer 0", "base64"}},
    {"CutBase64",
     [](GltfBuilder& f) {
         f.json["buffers"] = {{{"byteLength", 3}, {"uri", "data:;base64,AAAAA"}}};
     },
     {"buffer 0", "base64"}},
    {"DataUriWithoutBase64",
     [](GltfBuilder& f) {
         f.json["buffers"] = {{{"byteLength", 3}, {"uri", "data:text/plain,abc"}}};
     },
     {"buffer 0", "base64"}},
    {"SparseCountBeyondTheAccessor",
     [](GltfBuilder& f) {
         f.json["accessors"][0]["sparse"] = {
             {"count", 4}, {"indices", {{"bufferView", 0}, {"componentType", 5125}}}, {"values", {{"bufferView", 0}}}};
     },
     {"accessor 0", "sparse.count is 4"}},
    {"SparseIndexOutOfRange",
     [](GltfBuilder& f) {
         const int indices = f.add_view<std::uint8_t>({0, 3});
         f.json["accessors"][0]["sparse"] = {{"count", 2},
                                             {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                                             {"values", {{"bufferView", 0}}}};
     },
     {"accessor 0", "sparse index 1 is 3"}},
    {"SparseIndicesOutOfOrder",
     [](GltfBuilder& f) {
         const int indices = f.add_view<std::uint8_t>({1, 0});
         f.json["accessors"][0]["sparse"] = {{"count", 2},
                                             {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                                             {"values", {{"bufferView", 0}}}};
     },
     {"accessor 0", "increase"}},

    // Meshes.
    {"IndexOutOfRange",
     [](GltfBuilder& f) {
         f.primitive()["indices"] = f.add_accessor<std::uint16_t>({0, 1, 3}, "SCALAR");
     },
     {"mesh 0 'shape'", "accessor 1", "index 2 is 3", "3 vertices"}},
    {"FloatIndices",
     [](GltfBuilder& f) {
         f.primitive()["indices"] = f.add_accessor<float>({0, 1, 2}, "SCALAR");
     },
     {"accessor 1", "unsigned"}},
    {"VectorIndices",
     [](GltfBuilder& f) {
         f.primitive()["indices"] = f.add_accessor<std::uint8_t>({0, 1, 2, 0}, "VEC2");
     },
     {"accessor 1", "SCALAR"}},
    {"IndexCountNotAMultipleOfThree",
     [](GltfBuilder& f) {
         f.primitive()["indices"] = f.add_accessor<std::uint16_t>({0, 1, 2, 0}, "SCALAR");
     },
     {"mesh 0 'shape'", "4 indices", "multiple of 3"}},
    {"UnknownMode", [](GltfBuilder& f) { f.primitive()["mode"] = 7; }, {"/meshes/0/primitives/0/mode", "7"}},
    {"AttributesOfDifferentCounts",
     [](GltfBuilder& f) {
         f.primitive()["attributes"]["NORMAL"] = f.add_accessor<float>({0, 0, 1, 0, 0, 1}, "VEC3");
     },
     {"mesh 0 'shape'", "NORMAL has 2 elements, but POSITION has 3"}},
    {"PrimitiveWithoutAttributes",
     [](GltfBuilder& f) { f.primitive().erase("attributes"); },
     {"/meshes/0/primitives/0", "'attributes' is missing"}},
    {"JointOutOfRange",
     [](GltfBuilder& f) {
         f.primitive()["attributes"]["JOINTS_0"] =
             f.add_accessor<std::uint8_t>(std::vector<std::uint8_t>(12, 5), "VEC4");
         f.primitive()["attributes"]["WEIGHTS_0"] = f.add_accessor<float>(std::vector<float>(12, 1.0f), "VEC4");
         f.json["skins"] = {{{"joints", {0}}}};
         f.json["nodes"][0]["skin"] = 0;
     },
     {"mesh 0 'shape'", "joint 5", "has 1"}},
    {"SkinWithoutJoints",
     [](GltfBuilder& f) {
         f.json["skins"] = {{{"joints", nlohmann::json::array()}}};
         f.json["nodes"][0]["skin"] = 0;
     },
     {"skin 0", "no joints"}},
    {"TooFewInverseBindMatrices",
     [](GltfBuilder& f) {
         f.json["skins"] = {
             {{"joints", {0, 0}}, {"inverseBindMatrices", f.add_accessor<float>(std::vector<float>(16), "MAT4")}}};
         f.json["nodes"][0]["skin"] = 0;
     },
     {"skin 0", "2 joints, but 1"}},
    {"InstancesOfDifferentCounts",
     [](GltfBuilder& f) {
         f.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
             {"TRANSLATION", 0}, {"SCALE", f.add_accessor<float>({1, 1, 1}, "VEC3")}};
     },
     {"node 0 'place'", "SCALE has 1 elements"}},

    // Nodes.
    {"NodeIsItsOwnChild", [](GltfBuilder& f) { f.json["nodes"][0]["children"] = {0}; }, {"node 0 'place'", "cycle"}},
    {"NodesInACycle",
     [](GltfBuilder& f) {
         f.json["nodes"][0]["children"] = {1};
         f.json["nodes"].push_back({{"children", {0}}});
     },
     {"cycle"}},
    {"NodeWithTwoParents",
     [](GltfBuilder& f) {
         f.json["nodes"][0]["children"] = {2};
         f.json["nodes"].push_back({{"children", {2}}});
         f.json["nodes"].push_back({{"name", "shared"}});
     },
     {"node 2 'shared'", "node 0 and of node 1"}},
    {"UnknownChild", [](GltfBuilder& f) { f.json["nodes"][0]["children"] = {5}; }, {"/nodes/0/children/0", "node 5"}},
    {"UnknownMesh", [](GltfBuilder& f) { f.json["nodes"][0]["mesh"] = 1; }, {"/nodes/0/mesh", "mesh 1", "only 1"}},
    {"UnknownMaterial",
     [](GltfBuilder& f) { f.primitive()["material"] = 0; },
     {"/meshes/0/primitives/0/material", "none"}},
    {"UnknownScene", [](GltfBuilder& f) { f.json["scene"] = 4; }, {"/scene", "scene 4"}},
    {"UnknownRoot", [](GltfBuilder& f) { f.json["scenes"][0]["nodes"] = {3}; }, {"/scenes/0/nodes/0", "node 3"}},
    {"MatrixOfFifteen",
     [](GltfBuilder& f) { f.json["nodes"][0]["matrix"] = std::vector<float>(15, 1.0f); },
     {"/nodes/0/matrix", "16 numbers"}},
    {"TranslationOfTwo",
     [](GltfBuilder& f) {
         f.json["nodes"][0]["translation"] = {1, 2};
     },
     {"/nodes/0/translation", "3 numbers"}},
    {"TextAsNumber",
     [](GltfBuilder& f) {
         f.json["nodes"][0]["scale"] = {1, "2", 3};
     },
     {"/nodes/0/scale/1", "the text \"2\""}},
    {"NumberBeyondFloat",
     [](GltfBuilder& f) {
         f.json["nodes"][0]["scale"] = {1, 1e300, 3};
     },
     {"/nodes/0/scale/1", "32-bit float"}},
    {"NodesAsObject",
     [](GltfBuilder& f) { f.json["nodes"] = nlohmann::json::object(); },
     {"/nodes", "expected an array"}},
    {"NodeAsNumber", [](GltfBuilder& f) { f.json["nodes"][0] = 3; }, {"/nodes/0", "expected an object"}},
    {"UnknownCamera", [](GltfBuilder& f) { f.json["nodes"][0]["camera"] = 0; }, {"/nodes/0/camera"}},
    {"UnknownLight",
     [](GltfBuilder& f) { f.json["nodes"][0]["extensions"]["KHR_lights_punctual"]["light"] = 0; },
     {"/nodes/0/extensions/KHR_lights_punctual/light"}},

    // Animations.
    {"KeysNotIncreasing",
     [](GltfBuilder& f) {
         animate(f, {0, 0}, {0, 0, 0, 0, 0, 0});
     },
     {"animation 0 'spin'", "channel 0", "increase"}},
    {"KeysNotANumber",
     [](GltfBuilder& f) {
         animate(f, {0, NAN}, {0, 0, 0, 0, 0, 0});
     },
     {"animation 0 'spin'", "increase"}},
    {"TooFewKeyValues",
     [](GltfBuilder& f) {
         animate(f, {0, 1}, {0, 0, 0});
     },
     {"animation 0 'spin'", "need 6 numbers", "holds 3"}},

    // Pictures.
    {"PictureThatIsNone",
     [](GltfBuilder& f) { add_picture(f, picture_uri("this is not a picture")); },
     {"image 0 'paint'"}},
    {"EmptyPicture", [](GltfBuilder& f) { add_picture(f, "data:image/png;base64,"); }, {"image 0 'paint'"}},
    {"CutPicture",
     [](GltfBuilder& f) { add_picture(f, picture_uri(png_text(16).substr(0, 60))); },
     {"image 0 'paint'"}},
    {"FlippedBitInPicture",
     [](GltfBuilder& f) {
         std::string png = png_text(16);
         png[png.size() - 20] = static_cast<char>(png[png.size() - 20] ^ 0x10);
         add_picture(f, picture_uri(png));
     },
     {"image 0 'paint'"}},
    {"PictureTooLarge",  // 20,000 x 20,000 texels in a few bytes: only the header is true
     [](GltfBuilder& f) {
         const unsigned char header[] = {0x89, 'P',  'N',  'G',  '\r', '\n', 0x1a, '\n', 0,    0,    0,   13,  'I', 'H',
                                         'D',  'R',  0,    0,    0x4e, 0x20, 0,    0,    0x4e, 0x20, 8,   6,   0,   0,
                                         0,    0xe3, 0x70, 0x46, 0x39, 0,    0,    0,    16,   'I',  'D', 'A', 'T'};
         add_picture(f, picture_uri(std::string(reinterpret_cast<const char*>(header), sizeof header)));
     },
     {"image 0 'paint'"},
     ErrorCode::out_of_memory},
    {"PictureWithoutSource",
     [](GltfBuilder& f) {
         add_picture(f, "");
         f.json["images"][0].erase("uri");
     },
     {"/images/0", "bufferView"}},
    {"UnknownTexture",
     [](GltfBuilder& f) {
         f.json["materials"] = {{{"normalTexture", {{"index", 2}}}}};
     },
     {"/materials/0/normalTexture/index", "texture 2"}},
    {"UnknownImage",
     [](GltfBuilder& f) {
         add_picture(f, "");
         f.json["textures"][0]["source"] = 3;
     },
     {"/textures/0/source", "image 3"}},
    {"UnknownFilter",
     [](GltfBuilder& f) {
         f.json["samplers"] = {{{"magFilter", 1}}};
     },
     {"/samplers/0/magFilter"}},
    {"UnknownWrap",
     [](GltfBuilder& f) {
         f.json["samplers"] = {{{"wrapT", 1}}};
     },
     {"/samplers/0/wrapT"}},

    // Files that must not be opened.
    {"PathThatLeavesTheFolder",
     [](GltfBuilder& f) {
         f.json["buffers"] = {{{"byteLength", 3}, {"uri", "../../etc/passwd"}}};
     },
     {"buffer 0", "../../etc/passwd", "leaves the folder"},
     ErrorCode::invalid_argument},
    {"EncodedPathThatLeavesTheFolder",
     [](GltfBuilder& f) {
         f.json["buffers"] = {{{"byteLength", 3}, {"uri", "a/%2e%2e/%2E./etc/passwd"}}};
     },
     {"buffer 0", "leaves the folder"},
     ErrorCode::invalid_argument},
    {"AbsolutePath",
     [](GltfBuilder& f) { add_picture(f, "/etc/passwd"); },
     {"image 0 'paint'", "absolute"},
     ErrorCode::invalid_argument},
    {"Http",
     [](GltfBuilder& f) { add_picture(f, "http://example.com/a.png"); },
     {"image 0 'paint'", "scheme 'http'"},
     ErrorCode::invalid_argument},
    {"FileScheme",
     [](GltfBuilder& f) { add_picture(f, "file:///etc/passwd"); },
     {"scheme 'file'"},
     ErrorCode::invalid_argument},
    {"Backslash", [](GltfBuilder& f) { add_picture(f, "..\\..\\a.png"); }, {"backslash"}, ErrorCode::invalid_argument},
    {"ZeroByte", [](GltfBuilder& f) { add_picture(f, "a%00.png"); }, {"zero byte"}, ErrorCode::invalid_argument},
    {"BadPercent", [](GltfBuilder& f) { add_picture(f, "a%zz.png"); }, {"'%'"}, ErrorCode::invalid_argument},
    {"FileWithoutAFolder",
     [](GltfBuilder& f) { add_picture(f, "a.png"); },
     {"not read from a folder"},
     ErrorCode::invalid_argument},

    // The file as a whole.
    {"UnknownRequiredExtensions",
     [](GltfBuilder& f) {
         f.json["extensionsRequired"] = {"KHR_mesh_quantization", "KHR_draco_mesh_compression", "EXT_x"};
     },
     {"'KHR_draco_mesh_compression', 'EXT_x'"},
     ErrorCode::unsupported},
    {"OldVersion",
     [](GltfBuilder& f) { f.json["asset"]["version"] = "1.0"; },
     {"'1.0'", "only 2.0"},
     ErrorCode::unsupported},
    {"NewerMinimum", [](GltfBuilder& f) { f.json["asset"]["minVersion"] = "2.1"; }, {"'2.1'"}, ErrorCode::unsupported},
    {"NoAsset", [](GltfBuilder& f) { f.json.erase("asset"); }, {"'asset' is missing"}},
    {"VersionAsNumber", [](GltfBuilder& f) { f.json["asset"]["version"] = 2; }, {"/asset/version", "expected a text"}},
};

INSTANTIATE_TEST_SUITE_P(Gltf, BrokenFile, testing::ValuesIn(faults),
                         [](const testing::TestParamInfo<Fault>& fault) { return std::string(fault.param.name); });

std::string error_of(const Expected<Scene>& scene) { return scene ? "accepted" : scene.error().message(); }

TEST(BrokenJson, IsRefusedWithItsPlace) {
    EXPECT_THAT(error_of(load_text("")), HasSubstr("line 1, column 1"));
    EXPECT_THAT(error_of(load_text("{\n  \"asset\": ,\n}")), HasSubstr("line 2, column 12"));
    EXPECT_THAT(error_of(load_text("{\"asset\":{\"version\":\"2.0\"}} x")), HasSubstr("line 1, column 29"));
    EXPECT_THAT(error_of(load_text("\xef\xbb\xbf{}")), HasSubstr("byte order mark"));
    EXPECT_THAT(error_of(load_text("{\"a\":\n\"\xff\"}")), HasSubstr("line 2"));
    EXPECT_THAT(error_of(load_text("{\"a\": 1e999}")), HasSubstr("line 1"));
    EXPECT_THAT(error_of(load_text("{\"a\": 1e999}")), HasSubstr("1e999"));
    EXPECT_THAT(error_of(load_text("{\"nodes\": [{}, {\"mesh\": 1, \"mesh\": 2}]}")),
                HasSubstr("/nodes/1: the key 'mesh' appears twice"));
    EXPECT_THAT(error_of(load_text("[1]")), HasSubstr("expected an object"));
    EXPECT_THAT(error_of(load_text("{\"a\": \"" + std::string(1'000'000, 'x'))).size(), testing::Lt(1000u))
        << "messages stay short";
}

TEST(BrokenJson, DeepNestingIsRefusedWithoutRecursion) {
    for (const char open : {'[', '{'}) {
        std::string text = R"({"asset":{"version":"2.0"},"extras":)";
        for (int i = 0; i < 1'000'000; ++i) text += open == '[' ? "[" : "{\"a\":";
        EXPECT_THAT(error_of(load_text(text)), HasSubstr("nested more than 64 deep"));
    }
}

TEST(BrokenJson, TextOfTheFileIsMadePrintable) {
    GltfBuilder file;
    file.json["meshes"][0]["name"] = "a\x1b[31m\nb";
    file.json["accessors"][0]["count"] = 99;
    const std::string message = error_of(file.load());
    EXPECT_THAT(message, HasSubstr("mesh 0 'a?[31m?b'"));
}

TEST(BrokenBinary, IsRefusedWithItsPlace) {
    const std::string whole = GltfBuilder().binary();
    const auto load = [](const std::string& bytes) { return error_of(load_gltf(as_bytes(bytes), "test.glb", "")); };
    for (std::size_t size = 4; size < whole.size(); ++size) {
        ASSERT_THAT(load(whole.substr(0, size)), HasSubstr("truncated")) << "cut to " << size << " bytes";
    }
    std::string version = whole;
    version[4] = 1;
    EXPECT_THAT(load(version), HasSubstr("version 1"));
    std::string chunk_type = whole;
    chunk_type[16] = 'X';
    EXPECT_THAT(load(chunk_type), HasSubstr("chunk 0"));
    std::string chunk_size = whole;
    chunk_size[14] = 0x7f;
    EXPECT_THAT(load(chunk_size), HasSubstr("chunk 0"));
    const Expected<Scene> longer = load_gltf(as_bytes(whole + "tail"), "test.glb", "");
    ASSERT_TRUE(longer);
    EXPECT_EQ(longer->warnings.size(), 1u);
}

TEST(BrokenBinary, EveryFlippedByteGivesASceneOrAnError) {
    const std::string whole = GltfBuilder().binary();
    for (std::size_t position = 0; position < whole.size(); ++position) {
        for (const int flip : {0x01, 0x20, 0x80, 0xff}) {
            std::string broken = whole;
            broken[position] = static_cast<char>(broken[position] ^ flip);
            const Expected<Scene> scene = load_gltf(as_bytes(broken), "test.glb", "");
            if (scene) {
                for (const Mesh& mesh : scene->meshes) {
                    for (const Primitive& primitive : mesh.primitives) expect_valid_primitive(*scene, primitive);
                }
            } else {
                EXPECT_FALSE(scene.error().reason.empty());
                EXPECT_NE(scene.error().code, ErrorCode::internal) << scene.error().message();
            }
        }
    }
}

TEST(Extensions, UnknownOnesThatAreOnlyUsedGiveAWarning) {
    GltfBuilder file;
    file.json["extensionsUsed"] = {"VENDOR_sparkles", "KHR_materials_unlit"};
    const Expected<Scene> scene = file.load();
    ASSERT_TRUE(scene) << scene.error().message();
    ASSERT_EQ(scene->warnings.size(), 1u);
    EXPECT_THAT(scene->warnings[0], HasSubstr("VENDOR_sparkles"));
}

TEST(Limits, PicturesAreRefusedBeforeTheyAreDecoded) {
    GltfBuilder file;
    add_picture(file, picture_uri(png_text(64)));
    LoadOptions options;
    EXPECT_TRUE(file.load(options));
    options.limits.image_side = 63;
    EXPECT_THAT(error_of(file.load(options)), HasSubstr("image 0 'paint'"));
    options.limits.image_side = 64;
    options.limits.image_bytes = 64 * 64 * 4 - 1;
    EXPECT_THAT(error_of(file.load(options)), HasSubstr("image 0 'paint'"));
}

TEST(Limits, PicturesCountTogether) {
    GltfBuilder file;
    add_picture(file, picture_uri(png_text(64)));
    file.json["images"].push_back({{"uri", picture_uri(png_text(32))}, {"name", "second"}});
    file.json["textures"].push_back({{"source", 1}});
    file.json["materials"][0]["normalTexture"] = {{"index", 1}};
    LoadOptions options;
    options.limits.image_bytes = (64 * 64 + 32 * 32) * 4;
    const Expected<Scene> fitting = file.load(options);
    EXPECT_TRUE(fitting) << error_of(fitting);
    options.limits.image_bytes -= 1;
    EXPECT_THAT(error_of(file.load(options)), HasSubstr("pictures of the scene need more than"));
}

TEST(Limits, JsonAndGeometryAreHeldToTheirLimits) {
    const GltfBuilder file;
    LoadOptions options;
    options.limits.json_bytes = 100;
    EXPECT_THAT(error_of(file.load(options)), HasSubstr("limit is 100"));
    options = {};
    options.limits.geometry_bytes = 50;
    EXPECT_THAT(error_of(file.load(options)), HasSubstr("more than 50 bytes"));
}

/// A folder for one test, removed afterwards.
class Files : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() /
                  ("nacre_scene_test_" + std::to_string(::testing::UnitTest::GetInstance()->random_seed()) + "_" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name() + std::to_string(::getpid()));
        std::filesystem::create_directories(folder_ / "data");
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    void write(const std::filesystem::path& name, std::string_view content) const {
        std::ofstream(folder_ / name, std::ios::binary)
            .write(content.data(), static_cast<std::streamsize>(content.size()));
    }
    [[nodiscard]] Expected<Scene> load(const std::string& name) const { return load_scene((folder_ / name).string()); }

    std::filesystem::path folder_;
};

GltfBuilder with_buffer_file(const std::string& uri) {
    GltfBuilder file;
    file.json["buffers"] = {{{"byteLength", file.data.size()}, {"uri", uri}}};
    return file;
}

TEST_F(Files, BuffersAndPicturesBesideTheSceneAreFound) {
    GltfBuilder file = with_buffer_file("data/a%20b.bin");
    add_picture(file, "data/paint.png");
    write("data/a b.bin", {reinterpret_cast<const char*>(file.data.data()), file.data.size()});
    write("data/paint.png", png_text(4));
    write("scene.gltf", file.text());
    const Expected<Scene> scene = load("scene.gltf");
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    EXPECT_EQ(scene->images.at(0).width, 4u);
    EXPECT_EQ(scene->images.at(0).origin, "data/paint.png");
}

TEST_F(Files, MissingAndShortFilesAreNamed) {
    write("scene.gltf", with_buffer_file("data/a.bin").text());
    EXPECT_THAT(error_of(load("scene.gltf")), testing::AllOf(HasSubstr("buffer 0"), HasSubstr("data/a.bin")));
    EXPECT_EQ(load("scene.gltf").error().code, ErrorCode::not_found);
    write("data/a.bin", "short");
    EXPECT_THAT(error_of(load("scene.gltf")), HasSubstr("5 bytes"));
    write("scene.gltf", with_buffer_file("data").text());
    EXPECT_THAT(error_of(load("scene.gltf")), HasSubstr("not a regular file"));
    EXPECT_EQ(load("other.gltf").error().code, ErrorCode::not_found);
    EXPECT_THAT(error_of(load("other.gltf")), HasSubstr("other.gltf"));
}

TEST_F(Files, FilesOutsideTheFolderAreNotOpenedThoughTheyExist) {
    const GltfBuilder file = with_buffer_file("../a.bin");
    write("a.bin", {reinterpret_cast<const char*>(file.data.data()), file.data.size()});
    write("data/scene.gltf", file.text());
    EXPECT_THAT(error_of(load("data/scene.gltf")), HasSubstr("leaves the folder"));
}

// The seeds of the fuzzer, whole and with a few thousand reproducible injuries: what the fuzzer looks for, in little.
TEST(Seeds, AreValidAndSurviveInjuries) {
    const std::filesystem::path folder = std::filesystem::path(NACRE_SOURCE_DIR) / "tests/seeds/gltf_fuzzer";
    std::mt19937 random(1);
    LoadOptions options{.time = 0.25f};
    options.limits.geometry_bytes = 16 << 20;
    options.limits.image_bytes = 4 << 20;
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        SCOPED_TRACE(entry.path().filename());
        ++count;
        std::ifstream file(entry.path(), std::ios::binary);
        const std::string whole((std::istreambuf_iterator<char>(file)), {});
        const Expected<Scene> scene = load_text(whole, options);
        ASSERT_TRUE(scene) << scene.error().message();
        expect_valid_scene(*scene);
        EXPECT_FALSE(scene->instances.empty());
        for (int injury = 0; injury < 300; ++injury) {
            std::string broken = whole;
            for (std::uint32_t i = 0, hits = 1 + random() % 3; i < hits; ++i) {
                const std::size_t position = random() % broken.size();
                switch (random() % 4) {
                    case 0: broken[position] = static_cast<char>(random()); break;
                    case 1: broken[position] = static_cast<char>('0' + random() % 10); break;
                    case 2: broken.erase(position, 1 + random() % 8); break;
                    case 3: broken.insert(position, broken.substr(random() % broken.size(), 1 + random() % 16)); break;
                }
            }
            const Expected<Scene> result = load_text(broken, options);
            if (result) {
                expect_valid_scene(*result);
            } else {
                EXPECT_NE(result.error().code, ErrorCode::internal) << result.error().message();
            }
            ASSERT_FALSE(testing::Test::HasFailure()) << broken;
        }
    }
    EXPECT_GE(count, 10);
}

}  // namespace
}  // namespace nacre::scene
