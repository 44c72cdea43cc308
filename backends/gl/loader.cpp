// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/loader.h"

#include <cstring>

namespace nacre::gl {

Expected<Functions> load_functions(GetAddress get_address, bool es) {
    Functions functions;
    const char* missing = nullptr;
#define NACRE_GL_LOAD(name, type)                                                        \
    functions.name = reinterpret_cast<PFNGL##type##PROC>(get_address("gl" #name));        \
    if (!functions.name && !missing) missing = "gl" #name;
#define NACRE_GL_LOAD_OPTIONAL(name, type, es_name)                                      \
    if (!es)                                                                             \
        functions.name = reinterpret_cast<PFNGL##type##PROC>(get_address("gl" #name));    \
    else if (std::strlen(es_name) != 0)                                                  \
        functions.name = reinterpret_cast<PFNGL##type##PROC>(get_address(es_name));
    NACRE_GL_COMMON_FUNCTIONS(NACRE_GL_LOAD)
    NACRE_GL_OPTIONAL_FUNCTIONS(NACRE_GL_LOAD_OPTIONAL)
#undef NACRE_GL_LOAD
#undef NACRE_GL_LOAD_OPTIONAL
    if (missing)
        return fail(ErrorCode::unsupported, "load OpenGL functions", missing, "the driver does not have this function",
                    es ? "Use a driver with OpenGL ES 3.1." : "Use a driver with OpenGL 4.5.");
    return functions;
}

}  // namespace nacre::gl
