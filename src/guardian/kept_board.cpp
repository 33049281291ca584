#include "guardian/kept_board.hpp"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <variant>

#include "abs_hil/driver/backend.hpp"

namespace abs_hil::guardian {

namespace {

/// The same folder has one name, whatever links lead to it.
std::string plain(const std::string& text) {
  if (!text.starts_with('/')) return text.empty() ? "the only one" : text;
  std::error_code error;
  const std::filesystem::path path = std::filesystem::weakly_canonical(text, error);
  return error ? text : path.string();
}

}  // namespace

std::string kept_board(const driver::DriverOptions& options) {
  const auto boards = driver::registered_backends();
  const auto entry = std::ranges::find(boards, options.kind, &driver::Backend::name);
  const driver::BoardOptions* found = options.boards.find(options.kind);
  if (entry == boards.end() || found == nullptr) return options.kind;
  // The texts among the free options say where the board is.
  std::string text = options.kind;
  driver::BoardOptions copy = *found;
  copy.visit_options("", [&](const std::string& name, const rig::OptionFacts&, const auto& value) {
    if (std::ranges::find(entry->free_options, std::string_view(name)) == entry->free_options.end()) return;
    if (const auto* const* place = std::get_if<std::string*>(&value)) text += ", " + name + " " + plain(**place);
  });
  return text;
}

std::unique_ptr<driver::SafeStateWriter> safe_state_writer_of(const driver::DriverOptions& options,
                                                              bool beside_guardian) {
  const driver::ChosenBackend chosen = driver::chosen_backend(options);
  driver::RunFacts facts = options.facts();
  facts.beside_guardian = beside_guardian;
  return chosen.entry.make_safe_state_writer(chosen.options, facts);
}

}  // namespace abs_hil::guardian
