// SPDX-License-Identifier: Apache-2.0
#include "passes/plan.h"
#include "samples/nacre/backends.h"
#include "samples/nacre/commands.h"
#include "samples/nacre/output.h"
#include "samples/nacre/session.h"

namespace nacre::command {

Outcome run(const ExplainArguments& arguments) {
    NACRE_TRY(const SceneSession scene, SceneSession::open(arguments.scene));
    const auto instance = make_instance();
    NACRE_TRY(const RenderSession session, scene.start(*instance, arguments.scene.backends.front(), false));
    print_result(arguments.scene.json, passes::to_text(session.renderer->plan()));
    NACRE_CHECK(write_json(arguments.scene.json, passes::to_json(session.renderer->plan())));
    NACRE_CHECK(write_graph(*session.renderer, arguments.scene.dump_graph));
    return ExitCode::success;
}

}  // namespace nacre::command
