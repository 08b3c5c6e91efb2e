// named_file.h - from the text of a path parameter to a file that is there.
#pragma once

#include "host/plugins/description.h"
#include "host/settings/run_options.h"
#include "host/settings/run_spec.h"

namespace dreamsearch {

// Makes the path in *value absolute and takes the file's SHA-256. A text that names no file (""
// or one without the parameter's endings) stays as it is.
//   Failure 66  there is no file, it is no regular file, or it cannot be read.
void TakeFile(const ParameterInfo& parameter, const Setting& setting, ResolvedValue* value);

}  // namespace dreamsearch
