// json_fields.h - values to JSON and back by the names of their fields.
//
// A struct lists its fields once, in a template member that both directions call:
//
//   template <typename Archive> void Fields(Archive* archive) {
//     (*archive)("name", &name);
//   }
//
// Members may be such structs, vectors, optionals and shared pointers of what can be a
// member, enums (their numbers), paths, and what nlohmann knows. JSON has no number for what
// is not finite: it is null, and null is read as NaN. Reading wants every field but those
// listed with AddedLater, and passes over others; it throws nlohmann::json::exception.
//
// It includes all of nlohmann's library: for source files, not for headers.
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace dreamsearch::results {

template <typename T>
nlohmann::json FieldsToJson(const T& value);
template <typename T>
void FieldsFromJson(const nlohmann::json& json, T* value);

class JsonWriter {
 public:
  explicit JsonWriter(nlohmann::json* json) : json_(json) {}
  template <typename T>
  void operator()(const char* name, const T* value) {
    (*json_)[name] = FieldsToJson(*value);
  }
  template <typename T>
  void AddedLater(const char* name, const T* value) {
    (*this)(name, value);
  }

 private:
  nlohmann::json* json_;
};

class JsonReader {
 public:
  explicit JsonReader(const nlohmann::json* json) : json_(json) {}
  template <typename T>
  void operator()(const char* name, T* value) {
    FieldsFromJson(json_->at(name), value);
  }
  // A field that files of older programs lack: the value stays as it is.
  template <typename T>
  void AddedLater(const char* name, T* value) {
    if (json_->contains(name)) (*this)(name, value);
  }

 private:
  const nlohmann::json* json_;
};

template <typename T>
concept HasFields = requires(T& value, JsonWriter* writer) {
  value.Fields(writer);
};

// Overloads for what holds other values; the last one is for all else.
template <typename T>
nlohmann::json HeldToJson(const std::vector<T>& values) {
  nlohmann::json json = nlohmann::json::array();
  for (const T& value : values) json.push_back(FieldsToJson(value));
  return json;
}
template <typename T>
nlohmann::json HeldToJson(const std::optional<T>& value) {
  return value ? FieldsToJson(*value) : nlohmann::json();
}
template <typename T>
nlohmann::json HeldToJson(const std::shared_ptr<const T>& value) {
  return FieldsToJson(*value);
}
inline nlohmann::json HeldToJson(const std::filesystem::path& path) { return path.string(); }
template <typename T>
nlohmann::json HeldToJson(const T& value) {
  return value;
}

template <typename T>
void HeldFromJson(const nlohmann::json& json, std::vector<T>* values) {
  values->clear();
  for (const nlohmann::json& item : json) FieldsFromJson(item, &values->emplace_back());
}
template <typename T>
void HeldFromJson(const nlohmann::json& json, std::optional<T>* value) {
  value->reset();
  if (!json.is_null()) FieldsFromJson(json, &value->emplace());
}
template <typename T>
void HeldFromJson(const nlohmann::json& json, std::shared_ptr<const T>* value) {
  const auto made = std::make_shared<T>();
  FieldsFromJson(json, made.get());
  *value = made;
}
inline void HeldFromJson(const nlohmann::json& json, std::filesystem::path* path) {
  *path = json.get<std::string>();
}
inline void HeldFromJson(const nlohmann::json& json, double* number) {
  *number = json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>();
}
template <typename T>
void HeldFromJson(const nlohmann::json& json, T* value) {
  json.get_to(*value);
}

template <typename T>
nlohmann::json FieldsToJson(const T& value) {
  if constexpr (HasFields<T>) {
    nlohmann::json json = nlohmann::json::object();
    JsonWriter writer(&json);
    const_cast<T&>(value).Fields(&writer);  // it only reads them
    return json;
  } else if constexpr (std::is_enum_v<T>) {
    return static_cast<std::underlying_type_t<T>>(value);
  } else {
    return HeldToJson(value);
  }
}

template <typename T>
void FieldsFromJson(const nlohmann::json& json, T* value) {
  if constexpr (HasFields<T>) {
    JsonReader reader(&json);
    value->Fields(&reader);
  } else if constexpr (std::is_enum_v<T>) {
    *value = static_cast<T>(json.get<std::underlying_type_t<T>>());
  } else {
    HeldFromJson(json, value);
  }
}

template <typename T>
T FieldsFromJson(const nlohmann::json& json) {
  T value;
  FieldsFromJson(json, &value);
  return value;
}

}  // namespace dreamsearch::results
