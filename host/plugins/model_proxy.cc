#include "host/plugins/model_proxy.h"

#include <cmath>

#include "host/plugins/call_site.h"

namespace dreamsearch {
namespace {

// For %llu.
unsigned long long Printed(std::uint64_t number) { return number; }

// Index of the first entry outside [low, high], NaN included, or `size`.
std::uint64_t FirstOutside(const double* data, std::uint64_t size, double low, double high) {
  for (std::uint64_t i = 0; i < size; ++i) {
    if (!(data[i] >= low && data[i] <= high)) return i;
  }
  return size;
}

// Index of the first entry that is not finite, or `size`.
std::uint64_t FirstNotFinite(const double* data, std::uint64_t size) {
  for (std::uint64_t i = 0; i < size; ++i) {
    if (!std::isfinite(data[i])) return i;
  }
  return size;
}

}  // namespace

ModelProxy::ModelProxy(LatentModel* model, std::string name, bool searches)
    : model_(model),
      spread_(ExtensionOf<ValueSpread>(model)),
      gradient_(ExtensionOf<ReturnGradient>(model)),
      name_(std::move(name)),
      searches_(searches),
      latent_bytes_(model->latent_bytes()),
      action_size_(model->action_size()) {}

Status ModelProxy::Keep(Status status) noexcept {
  if (!status.ok() && fault_.ok()) fault_ = status;
  return status;
}

Status ModelProxy::KeepFailure(const char* call, const Status& status) noexcept {
  return Keep(Error(status.code, "model '%s' %s: %s", name_.c_str(), call, status.message));
}

Status ModelProxy::NotDeclared(const char* call) const noexcept {
  return Error(StatusCode::kFailedPrecondition,
               "model '%s': %s was called by a planner that does not declare kSearches",
               name_.c_str(), call);
}

Status ModelProxy::Imagine(const ImagineRequest& request, const ImagineResult& result) noexcept {
  if (!searches_) return Keep(NotDeclared("Imagine"));
  const std::uint64_t rows = request.latents.rows;
  if (request.latents.cols != latent_bytes_ || request.actions.rows != rows ||
      request.actions.cols != action_size_ || request.seeds.size != rows ||
      result.latents.rows != rows || result.latents.cols != latent_bytes_ ||
      result.rewards.size != rows || result.discounts.size != rows) {
    return Keep(Error(
        StatusCode::kInvalidArgument,
        "model '%s': Imagine of %llu latents of %llu bytes was given actions [%llu, "
        "%llu], %llu seeds, and room for latents [%llu, %llu], %llu rewards and %llu "
        "discounts; %llu bytes and %llu action components expected",
        name_.c_str(), Printed(rows), Printed(request.latents.cols), Printed(request.actions.rows),
        Printed(request.actions.cols), Printed(request.seeds.size), Printed(result.latents.rows),
        Printed(result.latents.cols), Printed(result.rewards.size), Printed(result.discounts.size),
        Printed(latent_bytes_), Printed(action_size_)));
  }
  if (FirstNotFinite(request.actions.data, request.actions.size()) != request.actions.size()) {
    return Keep(Error(StatusCode::kNotFinite,
                      "model '%s': Imagine was asked about an action that "
                      "is not finite",
                      name_.c_str()));
  }
  const std::byte* from = request.latents.data;
  const std::byte* to = result.latents.data;
  if (rows > 0 && from < to + result.latents.size() && to < from + request.latents.size()) {
    return Keep(
        Error(StatusCode::kInvalidArgument,
              "model '%s': Imagine was given room for its latents that overlaps the latents "
              "it begins at; imagine into other memory",
              name_.c_str()));
  }
  transitions_ += rows;
  const CallScope scope({"model", name_.c_str(), "Imagine"});
  const Status status = model_->Imagine(request, result);
  if (!status.ok()) return KeepFailure("Imagine", status);
  if (const std::uint64_t i = FirstNotFinite(result.rewards.data, rows); i != rows) {
    return Keep(Error(StatusCode::kNotFinite, "model '%s': imagined reward %g is not finite",
                      name_.c_str(), result.rewards[i]));
  }
  if (const std::uint64_t i = FirstOutside(result.discounts.data, rows, 0, 1); i != rows) {
    const double discount = result.discounts[i];
    return Keep(Error(std::isfinite(discount) ? StatusCode::kInternal : StatusCode::kNotFinite,
                      "model '%s': imagined discount %g of row %llu is %s", name_.c_str(), discount,
                      static_cast<unsigned long long>(i),
                      std::isfinite(discount) ? "outside [0, 1]" : "not finite"));
  }
  return OkStatus();
}

Status ModelProxy::KeepUnlessFinite(const char* what, View<const double> values) noexcept {
  const std::uint64_t i = FirstNotFinite(values.data, values.size);
  if (i == values.size) return OkStatus();
  return Keep(Error(StatusCode::kNotFinite, "model '%s': %s %g of row %llu is not finite",
                    name_.c_str(), what, values[i], Printed(i)));
}

Status ModelProxy::Value(ConstLatents latents, View<double> values) noexcept {
  if (latents.cols != latent_bytes_ || values.size != latents.rows) {
    return Keep(Error(StatusCode::kInvalidArgument,
                      "model '%s': Value of %llu latents of %llu bytes (expected %llu) was given "
                      "room for %llu values",
                      name_.c_str(), Printed(latents.rows), Printed(latents.cols),
                      Printed(latent_bytes_), Printed(values.size)));
  }
  const CallScope scope({"model", name_.c_str(), "Value"});
  const Status status = model_->Value(latents, values);
  if (!status.ok()) return KeepFailure("Value", status);
  return KeepUnlessFinite("value", values);
}

void* ModelProxy::Extension(const char* name) noexcept {
  void* own = Offers::Extension(name);
  if (own == static_cast<ValueSpread*>(this) && spread_ == nullptr) return nullptr;
  if (own == static_cast<ReturnGradient*>(this) && gradient_ == nullptr) return nullptr;
  return own;
}

Status ModelProxy::Spread(ConstLatents latents, const SpreadResult& request) noexcept {
  const SpreadResult result = Received(request);
  if (latents.cols != latent_bytes_ || !HasRoom(result, latents.rows)) {
    return Keep(Error(StatusCode::kInvalidArgument,
                      "model '%s': Spread of %llu latents was given views of other sizes",
                      name_.c_str(), static_cast<unsigned long long>(latents.rows)));
  }
  const CallScope scope({"model", name_.c_str(), "Spread"});
  Status status = spread_->Spread(latents, result);
  if (!status.ok()) return KeepFailure("Spread", status);
  status = KeepUnlessFinite("value", result.values);
  if (status.ok()) status = KeepUnlessFinite("deviation of a value", result.deviations);
  if (status.ok()) status = KeepUnlessFinite("least value", result.least);
  return status;
}

Status ModelProxy::Gradient(const GradientRequest& asked, const GradientResult& room) noexcept {
  if (!searches_) return Keep(NotDeclared("Gradient"));
  const GradientRequest request = Received(asked);
  const GradientResult result = Received(room);
  const std::uint64_t rows = request.latents.rows, steps = request.actions.rows;
  if (request.latents.cols != latent_bytes_ || rows == 0 || steps == 0 || steps % rows != 0 ||
      request.actions.cols != action_size_ || request.seeds.size != steps ||
      result.returns.size != rows || result.gradients.rows != steps ||
      result.gradients.cols != action_size_) {
    return Keep(Error(StatusCode::kInvalidArgument,
                      "model '%s': Gradient of %llu sequences was given views of other sizes",
                      name_.c_str(), static_cast<unsigned long long>(rows)));
  }
  if (FirstNotFinite(request.actions.data, request.actions.size()) != request.actions.size()) {
    return Keep(Error(StatusCode::kNotFinite,
                      "model '%s': Gradient was asked about an action that is not finite",
                      name_.c_str()));
  }
  transitions_ += steps;
  const CallScope scope({"model", name_.c_str(), "Gradient"});
  Status status = gradient_->Gradient(request, result);
  if (!status.ok()) return KeepFailure("Gradient", status);
  status = KeepUnlessFinite("imagined return", result.returns);
  if (!status.ok()) return status;
  return KeepUnlessFinite("gradient of a return", {result.gradients.data, result.gradients.size()});
}

Status ModelProxy::CheckProposals(MatrixView<const double> actions) noexcept {
  const std::uint64_t i = FirstOutside(actions.data, actions.size(), -1, 1);
  if (i == actions.size()) return OkStatus();
  const double action = actions.data[i];
  return Keep(Error(std::isfinite(action) ? StatusCode::kInternal : StatusCode::kNotFinite,
                    "model '%s': component %llu of proposed action %llu is %g, expected a number "
                    "in [-1, 1]",
                    name_.c_str(), static_cast<unsigned long long>(i % action_size_),
                    static_cast<unsigned long long>(i / action_size_), action));
}

Status ModelProxy::ProposeMode(ConstLatents latents, MatrixView<double> actions) noexcept {
  if (latents.cols != latent_bytes_ || actions.rows != latents.rows ||
      actions.cols != action_size_) {
    return Keep(
        Error(StatusCode::kInvalidArgument,
              "model '%s': ProposeMode of %llu latents of %llu bytes was given room for actions "
              "[%llu, %llu]; %llu bytes and %llu action components expected",
              name_.c_str(), Printed(latents.rows), Printed(latents.cols), Printed(actions.rows),
              Printed(actions.cols), Printed(latent_bytes_), Printed(action_size_)));
  }
  const CallScope scope({"model", name_.c_str(), "ProposeMode"});
  const Status status = model_->ProposeMode(latents, actions);
  if (!status.ok()) return KeepFailure("ProposeMode", status);
  return CheckProposals(actions);
}

Status ModelProxy::ProposeSamples(ConstLatents latents, View<const std::uint64_t> seeds,
                                  MatrixView<double> actions) noexcept {
  if (latents.cols != latent_bytes_ || latents.rows == 0 || actions.rows % latents.rows != 0 ||
      actions.cols != action_size_ || seeds.size != latents.rows) {
    return Keep(Error(
        StatusCode::kInvalidArgument,
        "model '%s': ProposeSamples of %llu latents of %llu bytes was given room for actions "
        "[%llu, %llu] and %llu seeds; %llu bytes and %llu action components expected",
        name_.c_str(), Printed(latents.rows), Printed(latents.cols), Printed(actions.rows),
        Printed(actions.cols), Printed(seeds.size), Printed(latent_bytes_), Printed(action_size_)));
  }
  const CallScope scope({"model", name_.c_str(), "ProposeSamples"});
  const Status status = model_->ProposeSamples(latents, seeds, actions);
  if (!status.ok()) return KeepFailure("ProposeSamples", status);
  return CheckProposals(actions);
}

}  // namespace dreamsearch
