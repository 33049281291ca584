// The one table of what the system, the loader and other programs say, with the cause and the fix for a person; makes
// bytes from elsewhere fit to show: valid UTF-8 without control characters.
#include "rig/formatted_text.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <initializer_list>
#include <system_error>

namespace abs_hil::rig {

namespace {

constexpr std::string_view replacement = "\uFFFD";

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

/// Number of bytes of the first character of `text`; 0 if it is invalid (RFC 3629, section 4).
std::size_t character_bytes(std::string_view text) {
  const auto first = static_cast<unsigned char>(text[0]);
  std::size_t size = 0;
  std::uint32_t code = 0;
  std::uint32_t least = 0;
  if (first < 0x80U) return 1;
  if (first >= 0xC2U && first < 0xE0U) {
    size = 2, code = first & 0x1FU, least = 0x80U;
  } else if (first >= 0xE0U && first < 0xF0U) {
    size = 3, code = first & 0x0FU, least = 0x800U;
  } else if (first >= 0xF0U && first < 0xF5U) {
    size = 4, code = first & 0x07U, least = 0x10000U;
  } else {
    return 0;
  }
  if (text.size() < size) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if (!is_continuation(text[i])) return 0;
    code = (code << 6U) | (static_cast<unsigned char>(text[i]) & 0x3FU);
  }
  const bool surrogate = code >= 0xD800U && code < 0xE000U;
  return code < least || surrogate || code > 0x10FFFFU ? 0 : size;
}

/// C0, DEL, C1, and marks that change the direction of writing, which can disguise text.
bool is_control(std::string_view character) {
  const auto first = static_cast<unsigned char>(character[0]);
  if (character.size() == 1) return first < 0x20U || first == 0x7FU;
  if (character.size() == 2) return first == 0xC2U && static_cast<unsigned char>(character[1]) < 0xA0U;
  return (character >= "\u200E" && character <= "\u200F") || (character >= "\u2028" && character <= "\u202E") ||
         (character >= "\u2066" && character <= "\u2069");
}

#ifdef _WIN32
constexpr std::string_view separators = "/\\";
#else
constexpr std::string_view separators = "/";
#endif
constexpr unsigned any = writing | reading | starting | reaching;
#ifdef _WIN32
constexpr int EDQUOT = ENOSPC, ESTALE = EIO;
#endif

struct ErrorRow {
  int number;
  int same;  ///< another number with the same fix
  unsigned deeds;
  std::string_view fix;  ///< {place}, {folder}: the place and its folder
};

// The first row that fits is taken.
constexpr ErrorRow errors[] = {
#ifdef _WIN32
    {ENOENT, 0, writing, R"(create the directory first: mkdir "{folder}")"},
    {EACCES, EPERM, writing, "choose a place that you may write to, and close the file in other programs"},
#endif
    {ENOENT, 0, writing, "create the directory first: mkdir -p '{folder}'"},
    {ENOENT, 0, starting, "install it there, with the rest of the program"},
    {ENOENT, 0, any, "correct the name"},
    {EEXIST, 0, any, "give a folder: this is a file"},
    {ENOTDIR, 0, any, "a part of the path is a file, not a directory: choose another path"},
    {EISDIR, 0, writing, "this is a directory: add a file name"},
    {EISDIR, 0, any, "this is a directory: give a file in it"},
    {EACCES, EPERM, writing, "choose a place that you may write to, or get the right to write to '{folder}'"},
    {EACCES, EPERM, starting, "let it be run (chmod +x '{place}'), and mount '{folder}' without noexec"},
    {EACCES, EPERM, any, "get the right to open it: `ls -l '{place}'` shows its owner and group"},
    {EROFS, 0, any, "the file system is read-only: choose another place"},
    {ENOSPC, EDQUOT, any, "free some space on that file system, or choose another"},
    {EFBIG, 0, any, "the file reached the size limit: raise it (ulimit -f), or log less"},
    {EMFILE, 0, any, "too many open files: raise the limit (ulimit -n)"},
    {ENFILE, 0, any, "all programs together have too many open files: raise the limit (sysctl fs.file-max)"},
    {ENAMETOOLONG, 0, reaching, "choose a shorter path: that of a socket has 107 bytes at most"},
    {ENAMETOOLONG, 0, any, "choose a shorter name: 255 bytes at most, 4095 with all its directories"},
    {ELOOP, 0, any, "its symbolic links lead in a circle: remove them"},
    {ETXTBSY, 0, any, "a program runs from this file: end it first, or choose another name"},
    {ENOEXEC, 0, any, "it is no program for this computer: install the one that was built for it"},
    {EAGAIN, ENOMEM, starting,
     "too little memory or too many processes: end some, or raise the limits (ulimit -v, -u)"},
    {EIO, ESTALE, any, "the disk, the device or its network has failed: dmesg says how"},
    {ENODEV, ENXIO, any, "the device is gone: check its plug and its power"},
    {EBUSY, 0, any, "another program or a driver of the kernel has it: end that first"},
    {EADDRINUSE, 0, any, "another program listens there: end it, or choose another place"},
    {EADDRNOTAVAIL, 0, any, "this computer has no such address: `ip address` lists those that it has"},
    {EAFNOSUPPORT, EPROTONOSUPPORT, any, "this kernel lacks that network: load its module (sudo modprobe {place})"},
    {ECONNREFUSED, 0, any, "no program listens there: start it, or correct the address"},
    {ENETUNREACH, EHOSTUNREACH, any, "no network leads there: check cable and address (ip route)"},
};

struct WordsRow {
  std::string_view words;
  std::string_view fix;
};

// Words of the loader (dlopen), of libzip and of sbatch. The first row whose words occur is taken.
constexpr WordsRow words_rows[] = {
    {"failed to map segment",
     "'{folder}' is mounted noexec, so that no program may run from it: move the file elsewhere, or, if this is the "
     "folder for temporary files, set TMPDIR to another one"},
    {"cannot map zero-fill", "it needs more memory than there is: make its arrays smaller"},
    {"wrong ELF class", "it is for 32 bits: build it for 64 bits (without -m32)"},
    {"libc.musl", "it was built on a system with another C library (musl, as Alpine's): build it here"},
    {"libc.so: invalid ELF header",
     "it was built on a system with another C library (musl, as Alpine's): build it here"},
    {"invalid ELF header", "it is no library for Linux: build it here, with cc -shared -fPIC"},
    {"file too short", "it is no library for Linux, or was cut off: build it here, with cc -shared -fPIC"},
    {"Is a directory", "this is a directory: give the library in it"},
    {"version `GLIBC", "it was built on a newer system: build it here"},
    {"not found (required by", "it was built with a newer version of that library: build it here"},
    {"undefined symbol: Py", "it needs Python's library: set LD_PRELOAD=libpython3.N.so.1.0, of the Python it is for"},
    {"undefined symbol", "link the library that defines it (as -lm), or compile the source that does"},
    {"cannot open shared object file: No such file", "install that library, or add its folder to LD_LIBRARY_PATH"},
    {"executable stack", "link it with -z noexecstack"},
    {"static TLS", "set LD_PRELOAD='{place}'"},
    {"Not a zip archive", "it was cut off, or is another kind of file: copy it again, in binary mode"},
    {"job array specification", "give a smaller --array (scontrol show config | grep MaxArraySize)"},
    {"SubmitJob", "the cluster lets you have fewer jobs: give a smaller --array, or wait until some have ended"},
    {"contact slurm controller", "the cluster's controller does not answer: try again later (scontrol ping)"},
    {"invalid partition", "name a partition of the cluster (sinfo): -- --partition=NAME"},
    {"Invalid account", "name your account (sacctmgr show associations): -- --account=NAME"},
};

std::string with_fix(std::string_view words, std::string_view fix, const std::string& place) {
  std::string text = std::string(words) + "; " + std::string(fix);
  const std::size_t end = place.find_last_of(separators);
  const std::string folder = end == std::string::npos ? "." : place.substr(0, std::max<std::size_t>(end, 1));
  for (const auto& [mark, value] : {std::pair<std::string_view, std::string>{"{place}", place}, {"{folder}", folder}}) {
    const std::size_t at = text.find(mark, words.size());
    if (at != std::string::npos) text.replace(at, mark.size(), value);
  }
  return text;
}

}  // namespace

std::string clean_text(std::string_view text, std::size_t most_characters, std::string_view kept) {
  std::string clean;
  std::size_t characters = 0;
  while (!text.empty()) {
    if (characters++ == most_characters) return clean + "\u2026";
    const std::size_t bytes = character_bytes(text);
    const std::string_view character = text.substr(0, std::max<std::size_t>(bytes, 1));
    const bool shown = bytes > 0 && (!is_control(character) || kept.find(character) != kept.npos);
    clean += shown ? character : replacement;
    text.remove_prefix(character.size());
  }
  return clean;
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t bytes = character_bytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string refusal(int error, const std::string& place, Deed deed) {
  const auto* const row = std::ranges::find_if(
      errors, [&](const ErrorRow& r) { return (r.number == error || r.same == error) && (r.deeds & deed) != 0; });
  return with_fix(std::generic_category().message(error), row != std::end(errors) ? row->fix : "choose another path",
                  place);
}

std::string refusal(std::string_view words, const std::string& place, std::string_view otherwise) {
  const auto* const row = std::ranges::find_if(
      words_rows, [&](const WordsRow& r) { return words.find(r.words) != std::string_view::npos; });
  const std::string_view fix = row != std::end(words_rows) ? row->fix : otherwise;
  return fix.empty() ? std::string(words) : with_fix(words, fix, place);
}

}  // namespace abs_hil::rig
