// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "tests/backends/cpu/differential/generated_shader.h"
#include "tests/backends/cpu/differential/random.h"

namespace nacre::differential {

enum class Kind : std::uint8_t { boolean, integer, natural, real, matrix };

/// A GLSL type: a scalar (size 1), a vector, or a matrix of `columns` vectors.
struct GlslType {
    Kind kind = Kind::integer;
    int size = 1;
    int columns = 1;
    friend bool operator==(const GlslType&, const GlslType&) = default;
    [[nodiscard]] std::string name() const;
};

/// Something that can be read, and perhaps written. '@' and '#' in the text stand for indices below count and
/// inner_count.
struct Place {
    std::string text;
    GlslType type;
    int count = 0, inner_count = 0;
    bool writable = true;
    bool is_uniform = false;  ///< Was equal in all invocations once, which is what makes it interesting.
    bool is_plain = false;    ///< A variable by itself, which may be passed as out or inout.
};

struct Parameter {
    enum class Way : std::uint8_t { in, out, inout } way = Way::in;
    GlslType type;
};

struct GlslFunction {
    std::string name;
    GlslType result;
    bool has_result = false;
    bool is_pure = true;      ///< May be called within an expression.
    std::vector<Parameter> parameters;
};

class Generator {
  public:
    explicit Generator(std::uint64_t seed);
    GeneratedShader make();

  private:
    // Expressions (expressions.cpp)
    std::string expression(const GlslType& type, int depth);
    std::string leaf(const GlslType& type);
    std::string literal(const GlslType& type);
    std::string boolean_expression(int size, int depth);
    std::string integer_expression(const GlslType& type, int depth);
    std::string real_expression(const GlslType& type, int depth);
    std::string matrix_expression(const GlslType& type, int depth);
    std::string construct(const GlslType& type, int depth);
    std::string index(int count);
    std::string fill_indices(const Place& place);
    std::string swizzle(int from, int count, bool distinct);
    std::string call(const GlslFunction& function, int depth);
    GlslType random_type(bool with_matrices = true);
    /// The value as bits of one uint.
    std::string as_bits(const std::string& value, const GlslType& type);

    // Statements (statements.cpp)
    void block(int statements);
    void statement();
    void declare();
    void assign();
    void note();
    void if_statement();
    void loop_statement();
    void switch_statement();
    void jump();
    void call_statement();
    void exchange();
    void atomic();
    void image();
    void approximate();
    void copy_structure();
    void write_result();
    void line(const std::string& text);
    void open(const std::string& text);
    void close(const std::string& text = "}");
    const Place* writable_place(const GlslType* type = nullptr, bool plain = false);

    // Whole shaders (stages.cpp)
    void declarations();
    void function(int number);
    void main_function();
    void local_variables(int count);

    Random random_;
    GeneratedShader shader_;
    std::vector<Place> places_;
    std::vector<std::string> structures_;   ///< Places of type Mixed, as in Place::text, with 3 elements behind '@'.
    std::vector<GlslFunction> functions_;
    GlslFunction* current_ = nullptr;       ///< Null: main.
    int indent_ = 0, depth_ = 0, names_ = 0, budget_ = 0;
    int index_depth_ = 0;                   ///< Indices within indices.
    int loops_ = 0, switches_ = 0;          ///< Around the statement, within the function.
    bool only_uniform_ = false;             ///< Leaves are of what is equal in all invocations.
    bool is_divergent_ = false;             ///< Some invocations may be elsewhere: no barrier.
    bool may_leave_ = true;                 ///< Jumps out of the loop that has barriers are not allowed.
    bool uses_barriers_ = false;
    bool left_ = false;                     ///< Invocations may have returned from main.
    std::vector<std::string> initial_;      ///< Statements at the start of main.
};

}  // namespace nacre::differential
