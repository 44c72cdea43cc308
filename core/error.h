// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <expected>
#include <string>
#include <string_view>
#include <utility>

/// @file
/// How everything in Nacre fails: whoever can fail returns `Expected<T>`, a value or an `Error`. No
/// exception crosses a public interface.
///
///     Expected<Scene> scene = load_gltf("car.gltf");
///     if (!scene) return std::unexpected(scene.error());   // or NACRE_TRY, below

namespace nacre {

/// What kind of failure it was, for programs that react to it. People read `Error::message()`.
enum class ErrorCode {
    invalid_argument,  ///< The caller passed something that can never work.
    not_found,         ///< A file, device, entry or name does not exist.
    unsupported,       ///< Valid, but this device, format or build cannot do it.
    out_of_memory,     ///< Host or device memory ran out, or a size exceeds what could ever be had.
    device_lost,       ///< The device is gone; destroy it and make a new one.
    input_output,      ///< The operating system refused a read, write or library load.
    parse,             ///< A file or text does not follow its format.
    shader_compile,    ///< GLSL or SPIR-V was rejected; the message holds the log.
    validation,        ///< Misuse of the render-hardware interface, found by its validation layer.
    timeout,           ///< A wait reached its limit; the work may still complete.
    internal,          ///< A bug in Nacre.
};

/// Stable lower-case name of a code ("invalid_argument", ...).
std::string_view name_of(ErrorCode code);

/// A failure, told in four parts so that its text always says what to do next.
struct Error {
    ErrorCode code = ErrorCode::internal;
    std::string attempted;  ///< What was attempted: "load scene", "create texture".
    std::string subject;    ///< On what: a path, an object's name, an element: "'car.gltf': accessor 17".
    std::string reason;     ///< Why it failed: expectation and finding, with figures.
    std::string remedy;     ///< What to do about it; empty only where nothing can be done.

    /// One line: "load scene 'car.gltf': accessor 17 ends at byte 81,920 but ... Export it again."
    [[nodiscard]] std::string message() const;
};

template <typename T>
using Expected = std::expected<T, Error>;

/// Shorthand for returning a failure from a function that returns `Expected<T>`.
[[nodiscard]] inline std::unexpected<Error> fail(ErrorCode code, std::string attempted, std::string subject,
                                                 std::string reason, std::string remedy = {}) {
    return std::unexpected<Error>(Error{code, std::move(attempted), std::move(subject), std::move(reason),
                                        std::move(remedy)});
}

}  // namespace nacre

#define NACRE_CONCATENATE_INNER(a, b) a##b
#define NACRE_CONCATENATE(a, b) NACRE_CONCATENATE_INNER(a, b)

/// Evaluates `expression` (an `Expected`); on failure returns its error from the enclosing function,
/// otherwise binds the value: `NACRE_TRY(auto image, read_image(path));`
#define NACRE_TRY(declaration, expression)                                              \
    auto NACRE_CONCATENATE(nacre_try_, __LINE__) = (expression);                        \
    if (!NACRE_CONCATENATE(nacre_try_, __LINE__))                                       \
        return std::unexpected(std::move(NACRE_CONCATENATE(nacre_try_, __LINE__)).error()); \
    declaration = *std::move(NACRE_CONCATENATE(nacre_try_, __LINE__))

/// As NACRE_TRY for `Expected<void>`, or where the value is not needed.
#define NACRE_CHECK(expression)                                                            \
    do {                                                                                   \
        if (auto nacre_check_ = (expression); !nacre_check_)                               \
            return std::unexpected(std::move(nacre_check_).error());                       \
    } while (false)
