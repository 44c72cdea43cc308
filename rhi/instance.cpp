// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "core/log.h"
#include "rhi/device_access.h"

namespace nacre::rhi {
namespace {

std::uint16_t next_device_number() {
    static std::atomic<std::uint32_t> last{0};
    // Numbers come round after 65,535 devices; by then the first ones and their handles are long gone.
    return static_cast<std::uint16_t>(last.fetch_add(1) % 0xffff + 1);
}

std::unexpected<Error> spec_error(std::string_view text, std::string reason) {
    return fail(ErrorCode::invalid_argument, "read backend", fmt::format("'{}'", text), std::move(reason),
                "A backend is written NAME[:MODE][:CHECK][:lanes=N][:threads=N], as in 'vulkan' or 'cpu:sanitize'.");
}

}  // namespace

Expected<BackendSpec> BackendSpec::parse(std::string_view text) {
    const auto is_word = [](std::string_view word) {
        return !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
            return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
        });
    };
    BackendSpec spec;
    std::size_t at = 0;
    bool is_past_words = false;
    for (int part = 0;; ++part) {
        const std::size_t end = std::min(text.find(':', at), text.size());
        const std::string_view word = text.substr(at, end - at);
        if (part == 0) {
            if (!is_word(word))
                return spec_error(
                    text, fmt::format("expected a name of lower-case letters, digits, '-' and '_', found '{}'", word));
            spec.name = word;
        } else if (const std::size_t equals = word.find('='); equals != std::string_view::npos) {
            const std::string_view option = word.substr(0, equals);
            const std::string_view digits = word.substr(equals + 1);
            std::uint32_t value = 0;
            const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
            if (error != std::errc{} || stop != digits.data() + digits.size() || value == 0)
                return spec_error(text, fmt::format("expected a number above 0 for '{}', found '{}'", option, digits));
            std::uint32_t* target = option == "lanes"     ? &spec.lanes
                                    : option == "threads" ? &spec.threads
                                    : option == "hostile" ? &spec.seed
                                                          : nullptr;
            if (!target)
                return spec_error(text,
                                  fmt::format("expected the options lanes, threads or hostile, found '{}'", option));
            if (*target != 0) return spec_error(text, fmt::format("expected '{}' once, found it twice", option));
            *target = value;
            is_past_words = is_past_words || target != &spec.seed;
            if (target == &spec.seed) spec.checks.emplace_back(option);
        } else {
            if (is_past_words || !is_word(word))
                return spec_error(
                    text, fmt::format("expected a mode, a check or an option 'name=number' after the name, found '{}'",
                                      word));
            if (part == 1)
                spec.mode = word;
            else if (std::ranges::find(spec.checks, word) == spec.checks.end() && word != spec.mode)
                spec.checks.emplace_back(word);
            else
                return spec_error(text, fmt::format("expected '{}' once, found it twice", word));
        }
        if (end == text.size()) break;
        at = end + 1;
    }
    return spec;
}

std::string BackendSpec::text() const {
    std::string text = name;
    if (!mode.empty()) text += ":" + mode;
    for (const std::string& check : checks)
        text += check == "hostile" && seed != 0 ? fmt::format(":hostile={}", seed) : ":" + check;
    if (lanes != 0) text += ":lanes=" + std::to_string(lanes);
    if (threads != 0) text += ":threads=" + std::to_string(threads);
    return text;
}

struct Instance::State {
    std::vector<std::unique_ptr<Backend>> backends;

    [[nodiscard]] Backend* find(std::string_view name) const {
        for (const auto& backend : backends)
            if (backend->name() == name) return backend.get();
        return nullptr;
    }
};

Instance::Instance(std::vector<std::unique_ptr<Backend>> backends) : state_(std::make_unique<State>()) {
    state_->backends = std::move(backends);
}
Instance::~Instance() = default;

std::vector<AdapterInfo> Instance::adapters() const {
    std::vector<AdapterInfo> all;
    for (const auto& backend : state_->backends)
        if (auto found = backend->adapters()) all.insert(all.end(), found->begin(), found->end());
    return all;
}

std::vector<UnavailableBackend> Instance::unavailable() const {
    std::vector<UnavailableBackend> all;
    for (const auto& backend : state_->backends) {
        auto found = backend->adapters();
        if (!found)
            all.push_back({std::string(backend->name()), found.error()});
        else if (found->empty())
            all.push_back({std::string(backend->name()),
                           Error{ErrorCode::not_found, "list devices", "'" + std::string(backend->name()) + "'",
                                 "the driver offers no device", "Install a driver for this machine."}});
    }
    return all;
}

std::vector<std::string> Instance::backend_names() const {
    std::vector<std::string> names;
    for (const auto& backend : state_->backends) names.emplace_back(backend->name());
    return names;
}

Expected<std::unique_ptr<Device>> Instance::create_device(const DeviceDesc& desc) const {
    NACRE_TRY(const BackendSpec spec, BackendSpec::parse(desc.backend));
    const auto attempt = [&](Backend& backend, BackendSpec wanted) -> Expected<std::unique_ptr<Device>> {
        const auto modes = backend.modes();
        const auto is_check = [&](std::string_view word) {
            return std::ranges::any_of(backend.checks(),
                                       [&](const Backend::Mode& check) { return check.name == word; });
        };
        if (is_check(wanted.mode)) {
            wanted.checks.insert(wanted.checks.begin(), wanted.mode);
            wanted.mode.clear();
        }
        for (const std::string& check : wanted.checks)
            if (!is_check(check)) {
                std::string names;
                for (const Backend::Mode& known_check : backend.checks())
                    names += fmt::format("{}'{}'", names.empty() ? "" : ", ", known_check.name);
                return fail(ErrorCode::invalid_argument, "create device", "'" + desc.backend + "'",
                            fmt::format("expected {}, found '{}'",
                                        names.empty() ? "no checks" : "one of the checks " + names, check),
                            "Leave it out.");
            }
        const bool known =
            wanted.mode.empty() || std::any_of(modes.begin(), modes.end(),
                                               [&](const Backend::Mode& mode) { return mode.name == wanted.mode; });
        if (!known) {
            std::string names;
            for (const Backend::Mode& mode : modes)
                if (!mode.name.empty()) names += fmt::format("{}'{}'", names.empty() ? "" : ", ", mode.name);
            return fail(ErrorCode::invalid_argument, "create device", "'" + desc.backend + "'",
                        fmt::format("expected {}, found mode '{}'",
                                    names.empty() ? "no mode" : "one of the modes " + names, wanted.mode),
                        "Leave the mode out for the default.");
        }
        const auto option = [&](const char* name) {
            return fail(ErrorCode::invalid_argument, "create device", "'" + desc.backend + "'",
                        fmt::format("expected an option that backend '{}' knows, found '{}'", backend.name(), name),
                        "Leave the option out.");
        };
        if (wanted.lanes != 0 && !backend.accepts_lanes()) return option("lanes");
        if (wanted.threads != 0 && !backend.accepts_threads()) return option("threads");

        auto state = std::make_unique<Device::State>();
        state->number = next_device_number();
        state->shared = std::make_shared<DeviceShared>(state->number);
        state->shared->desc = desc;
        BackendDeviceDesc backend_desc;
        backend_desc.spec = wanted;
        backend_desc.desc = &state->shared->desc;
        backend_desc.report = [sink = std::weak_ptr(state->shared)](const Message& message) {
            if (const auto shared = sink.lock()) shared->messages.send(message);
        };
        NACRE_TRY(state->backend, backend.create_device(backend_desc));
        state->adapter = state->backend->adapter();
        state->shared->capabilities = state->backend->capabilities();
        // Some drivers have textures of three 32-bit channels; this interface has them as vertex attributes alone, and
        // what the capabilities say must be what `create_texture` takes.
        for (std::uint32_t i = 0; i < format_count; ++i) {
            FormatSupport& support = state->shared->capabilities.formats[i];
            if (info(static_cast<Format>(i)).block_bytes == 12)
                support = has_all(support, FormatSupport::vertex) ? FormatSupport::vertex : FormatSupport::none;
        }
        NACRE_TRY(state->shared->capabilities, restrict_capabilities(state->shared->capabilities, desc.restriction));
        return std::unique_ptr<Device>(new Device(std::move(state)));
    };

    // A wrong restriction is wrong whatever the device.
    NACRE_CHECK(restrict_capabilities(Capabilities{}, desc.restriction));
    if (spec.name != "auto") {
        Backend* backend = state_->find(spec.name);
        if (!backend) {
            std::string names = "'auto'";
            for (const auto& known : state_->backends) names += fmt::format(", '{}'", known->name());
            return fail(ErrorCode::not_found, "create device", "'" + desc.backend + "'",
                        fmt::format("expected one of the backends {}, found '{}'", names, spec.name),
                        "Choose a backend that this program was built with.");
        }
        return attempt(*backend, spec);
    }
    if (!spec.mode.empty() || !spec.checks.empty() || spec.lanes != 0 || spec.threads != 0)
        return spec_error(desc.backend, "expected no mode and no options for 'auto'");
    std::string reasons;
    for (const auto& backend : state_->backends) {
        BackendSpec wanted;
        wanted.name = backend->name();
        auto device = attempt(*backend, wanted);
        if (device) return device;
        log_message(LogLevel::debug,
                    fmt::format("backend '{}' is left out: {}", backend->name(), device.error().message()));
        reasons += fmt::format("{}{}: {}", reasons.empty() ? "" : "; ", backend->name(), device.error().message());
    }
    return fail(ErrorCode::not_found, "create device", "'auto'",
                reasons.empty() ? "the program has no backend" : "no backend works here: " + reasons,
                "Install a driver (mesa-vulkan-drivers or libegl1 with libgl1-mesa-dri on Debian).");
}

}  // namespace nacre::rhi
