// Folders named after what people call an experiment or a controller, in letters that other tools take.
#include <fmt/chrono.h>
#include <fmt/format.h>
#ifndef _WIN32
#include <unistd.h>
#endif

#include <algorithm>
#include <cctype>

#include "rig/formatted_text.hpp"
#include "run_folder/run_folder.hpp"

namespace abs_hil::run_folder {

namespace fs = std::filesystem;

namespace {

/// Letters from `first` on in ASCII: Latin ones without their marks, Greek by ELOT 743, Cyrillic as passports have it.
struct Script {
  char32_t first;
  std::string_view letters;
};
constexpr Script scripts[] = {
    {0xB5, "m"},
    {0xC0,
     "A A A A A A AE C E E E E I I I I D N O O O O O - O U U U U Y Th ss a a a a a a ae c e e e e i i i i d n o o o o "
     "o - o u u u u y th y A a A a A a C c C c C c C c D d D d E e E e E e E e E e G g G g G g G g H h H h I i I i I i "
     "I i I i IJ ij J j K k k L l L l L l L l L l N n N n N n n N n O o O o O o OE oe R r R r R r S s S s S s S s T t "
     "T t T t U u U u U u U u U u U u W w Y y Y Z z Z z Z z s"},
    {0x386,
     "A - E I I - O - Y O i A V G D E Z I Th I K L M N X O P R - S T Y F Ch Ps O I Y a e i i y a v g d e z i th i k l "
     "m n x o p r s s t y f ch ps o i y o y o"},
    {0x400,
     "E Yo Dj G Ye Dz I Yi J Lj Nj C K I U Dz A B V G D E Zh Z I Y K L M N O P R S T U F Kh Ts Ch Sh Shch  Y  E Yu "
     "Ya a b v g d e zh z i y k l m n o p r s t u f kh ts ch sh shch  y  e yu ya e yo dj g ye dz i yi j lj nj c k i "
     "u dz"}};

/// A character, of that code and those bytes, as a part of a name; "-" for what is no letter.
std::string in_ascii(char32_t code, std::string_view bytes) {
  constexpr std::string_view kept = "_=.";
  if (code < 0x80)
    return std::isalnum(static_cast<int>(code)) != 0 || kept.find(bytes) != kept.npos ? std::string(bytes) : "-";
  for (const Script& script : scripts) {
    const auto letters = rig::split(script.letters, ' ');
    if (code >= script.first && code - script.first < letters.size()) return std::string(letters[code - script.first]);
  }
  if (code >= 0x300 && code < 0x370) return {};  // a mark of the letter before
  // Letters of other scripts stay; between them are signs, and behind them what has no form of its own.
  return (code >= 0x531 && code < 0x2000) || (code >= 0x3041 && code < 0xD800) ? std::string(bytes) : "-";
}

}  // namespace

std::string folder_name(std::string_view text, const fs::path& parent, std::size_t spare_bytes) {
  std::string name;
  for (std::size_t size = 0; !text.empty(); text.remove_prefix(size)) {
    const auto first = static_cast<unsigned char>(text.front());
    size = std::min<std::size_t>(first < 0xC0 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4, text.size());
    char32_t code = size == 1 ? first : first & (0x7FU >> size);
    for (const char c : text.substr(1, size - 1)) code = code << 6U | (static_cast<unsigned char>(c) & 0x3FU);
    const std::string piece = in_ascii(code, text.substr(0, size));
    if (piece != "-") {
      name += piece;
    } else if (!name.empty() && name.back() != '-') {
      name += '-';
    }
  }
  std::size_t most = 255;
#ifndef _WIN32
  if (const long allowed = ::pathconf(parent.empty() ? "." : parent.c_str(), _PC_NAME_MAX); allowed > 0)
    most = static_cast<std::size_t>(allowed);
#endif
  for (most -= spare_bytes; most < name.size() && (name[most] & 0xC0) == 0x80;) --most;  // not within a character
  name.resize(std::min(most, name.size()));
  name.erase(name.find_last_not_of("-.") + 1);
  return name.empty() ? "unnamed" : name;
}

fs::path unused_folder(const fs::path& parent, const std::tm& local_time, std::string_view experiment) {
  constexpr std::size_t around = 32;  // date and time, and a number at the end
  const fs::path path(experiment);
  const std::string name = path.extension() == ".toml" ? path.stem().string() : path.string();
  const std::string base = fmt::format("{:%Y%m%d-%H%M%S}-{}", local_time, folder_name(name, parent, around));
  std::error_code error;
  fs::create_directories(parent, error);
  fs::path folder = parent / base;
  // Another program may make the same one in this second: who makes it has it.
  for (int i = 2; !fs::create_directory(folder, error) && !error; ++i) folder = parent / fmt::format("{}-{}", base, i);
  return folder;
}

}  // namespace abs_hil::run_folder
