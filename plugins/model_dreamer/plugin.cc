// The plugin model_dreamer: one component, the model `dreamer`.
#include "dreamsearch/plugin.h"

#include "plugins/model_dreamer/dreamer.h"

namespace {

using dreamsearch::ComponentDescriptor;
using dreamsearch::ComponentKind;

const ComponentDescriptor kComponents[] = {{
    .kind = ComponentKind::kModel,
    .traits = dreamsearch::kLearns | dreamsearch::kDefault | dreamsearch::kLearnsFromSearch |
              dreamsearch::kGivesGradients,
    .name = "dreamer",
    .version = DREAMSEARCH_VERSION,
    .summary = "recurrent state-space model with actor and critic trained in its dreams",
    .parameters = dreamsearch::dreamer::DeclaredParameters(),
    .metrics = dreamsearch::dreamer::DeclaredMetrics(),
    .create_model = dreamsearch::dreamer::CreateDreamer,
}};

}  // namespace

DREAMSEARCH_PLUGIN("model_dreamer", DREAMSEARCH_VERSION, kComponents)
