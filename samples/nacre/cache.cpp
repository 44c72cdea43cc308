// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "core/disk_cache.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/output.h"
#include "samples/nacre/text_table.h"

namespace nacre::command {

Outcome run(const CacheArguments& arguments) {
    const DiskCache cache;
    nlohmann::ordered_json json{{"directory", cache.directory().string()}};
    std::string text;
    if (!cache.is_on()) {
        text = "Caching is off (NACRE_CACHE_DIR).\n";
        json["entries"] = json["bytes"] = 0;
    } else if (arguments.purge) {
        const std::uint64_t entries = cache.entries();
        const std::uint64_t freed = cache.purge();
        text = fmt::format("Removed {} entries, {}, from {}\n", entries, bytes_text(freed), cache.directory().string());
        json["removed_entries"] = entries;
        json["freed_bytes"] = freed;
    } else {
        TextTable table({"what", "entries", "size"});
        auto categories = nlohmann::ordered_json::array();
        for (const DiskCacheUsage& usage : cache.usage()) {
            table.add({usage.category, fmt::format("{}", usage.entries), bytes_text(usage.bytes)});
            categories.push_back({{"category", usage.category}, {"entries", usage.entries}, {"bytes", usage.bytes}});
        }
        const std::uint64_t entries = cache.entries();
        const std::uint64_t bytes = cache.size();
        table.add({"all", fmt::format("{}", entries), bytes_text(bytes)});
        text = cache.directory().string() + "\n" + table.text();
        json["entries"] = entries;
        json["bytes"] = bytes;
        json["categories"] = std::move(categories);
    }
    print_result(arguments.json, text);
    NACRE_CHECK(write_json(arguments.json, json.dump(2) + "\n"));
    return ExitCode::success;
}

}  // namespace nacre::command
