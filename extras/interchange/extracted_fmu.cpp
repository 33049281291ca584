// Unpacks an FMU with checks of every name and size.

#include <fmt/format.h>
#include <sys/stat.h>
#include <zip.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "interchange/confinement.hpp"
#include "interchange/fmu_facts.hpp"
#include "interchange/foreign_code.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::interchange {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t bytes_max = std::uint64_t{256} << 20U;
constexpr std::uint64_t description_bytes_max = std::uint64_t{16} << 20U;
constexpr unsigned entries_max = 2'000;

constexpr const char* description_name = "modelDescription.xml";

/// The folders of libraries for this computer: FMI 2 and FMI 3.
#if defined(__aarch64__)
constexpr std::array platform_folders{"binaries/aarch64-linux/", "binaries/aarch64-linux/"};
#else
constexpr std::array platform_folders{"binaries/linux64/", "binaries/x86_64-linux/"};
#endif

bool leads_out(std::string_view name) {
  if (name.empty() || name.front() == '/' || name.find('\\') != std::string_view::npos) return true;
  if (name.size() > 1 && name[1] == ':') return true;
  const fs::path path(name);
  return std::ranges::find(path, "..") != path.end();
}

bool is_wanted(std::string_view name) {
  if (name.ends_with('/')) return false;
  return name == description_name || name.starts_with("resources/") || name.starts_with(platform_folders[0]) ||
         name.starts_with(platform_folders[1]);
}

struct Closer {
  void operator()(zip_t* archive) const noexcept { zip_discard(archive); }
  void operator()(zip_file_t* file) const noexcept { zip_fclose(file); }
};

struct Entry {
  zip_uint64_t index{0};
  std::string name{};
  std::uint64_t size{0};
};

/// Checks all entries; returns those that are needed.
std::vector<Entry> entries_of(const fs::path& file, zip_t* archive) {
  const zip_int64_t count = zip_get_num_entries(archive, 0);
  std::vector<Entry> wanted;
  std::set<std::string> names;
  std::set<std::string> libraries;
  std::uint64_t bytes = 0;
  for (zip_int64_t n = 0; n < count; ++n) {
    const auto index = static_cast<zip_uint64_t>(n);
    zip_stat_t facts;
    zip_stat_init(&facts);
    const bool known = zip_stat_index(archive, index, ZIP_FL_ENC_GUESS, &facts) == 0;
    if (!known || (facts.valid & ZIP_STAT_NAME) == 0 || (facts.valid & ZIP_STAT_SIZE) == 0) {
      refuse(file, fmt::format("damaged: entry {} cannot be read", n));
    }
    const std::string name = facts.name;
    if (leads_out(name))
      refuse(file, fmt::format("its entry \"{}\" leads out of the archive; it is not extracted", name));
    if (!names.insert(name).second) refuse(file, fmt::format("it has two entries \"{}\"", name));
    zip_uint8_t system = 0;
    zip_uint32_t attributes = 0;
    zip_file_get_external_attributes(archive, index, 0, &system, &attributes);
    constexpr unsigned mode_shift = 16;
    if (system == ZIP_OPSYS_UNIX && S_ISLNK(attributes >> mode_shift)) {
      refuse(file, fmt::format("its entry \"{}\" is a symbolic link; it is not extracted", name));
    }
    if (facts.size > bytes_max || (bytes += facts.size) > bytes_max) {
      refuse(file, fmt::format("its files have more than {} bytes; it is not extracted", bytes_max));
    }
    if (name == description_name && facts.size > description_bytes_max) {
      refuse(file, fmt::format("its {} has {} bytes; at most {} are read", name, facts.size, description_bytes_max));
    }
    if (name.starts_with("binaries/") && !name.ends_with('/'))
      libraries.insert(fs::path(name).parent_path().filename().string());
    if (is_wanted(name)) wanted.push_back({index, name, facts.size});
  }
  if (!names.contains(description_name)) refuse(file, "not an FMU: it has no modelDescription.xml");
  for (const char* folder : platform_folders) {
    if (libraries.contains(fs::path(folder).parent_path().filename().string())) return wanted;
  }
  refuse(file, libraries.empty()
                   ? "it has no binaries; compile it with its sources in the tool that made it"
                   : fmt::format("it has libraries for {} only, not for this computer ({}); export it for Linux",
                                 fmt::join(libraries, ", "),
                                 fs::path(platform_folders[0]).parent_path().filename().string()));
}

[[noreturn]] void refuse_temporary(const fs::path& place, int error) {
  throw driver::Unavailable(fmt::format("an FMU is unpacked into the folder for temporary files (TMPDIR, /tmp): {}: {}",
                                        place.string(), rig::refusal(error, place, rig::writing)));
}

void extract(const fs::path& file, zip_t* archive, const Entry& entry, const fs::path& to) {
  std::error_code error;
  fs::create_directories(to.parent_path(), error);
  if (error) refuse_temporary(to, error.value());
  const std::unique_ptr<zip_file_t, Closer> in(zip_fopen_index(archive, entry.index, 0));
  if (!in) refuse(file, fmt::format("damaged: \"{}\": {}", entry.name, zip_strerror(archive)));
  std::ofstream out(to, std::ios::binary);
  std::array<char, 65'536> part;
  std::uint64_t got = 0;
  zip_int64_t more = 0;
  // Reading on to the end checks the sum. An entry may be longer than it says.
  while (got <= entry.size && (more = zip_fread(in.get(), part.data(), part.size())) > 0) {
    got += static_cast<std::uint64_t>(more);
    out.write(part.data(), more);
  }
  if (more < 0 || got != entry.size) refuse(file, fmt::format("damaged: \"{}\" cannot be unpacked", entry.name));
  out.close();
  if (!out) refuse_temporary(to, errno);
}

/// Where the tag ends that begins `text`: a '>' in quotes does not end it.
std::size_t end_of_tag(std::string_view text) {
  char quote = '\0';
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (quote != '\0') {
      if (text[i] == quote) quote = '\0';
    } else if (text[i] == '"' || text[i] == '\'') {
      quote = text[i];
    } else if (text[i] == '>') {
      return i;
    }
  }
  return text.size();
}

/// Counts elements, attributes and levels in the text without making anything of them: a parser needs a hundred bytes
/// for the four of "<a/>".
void check_description(const fs::path& file, const fs::path& description) {
  constexpr int elements_max = 200'000;
  constexpr int attributes_max = 1'000'000;
  constexpr int levels_max = 64;
  std::ifstream in(description, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  const auto check = [&](std::int64_t count, int most, const char* what) {
    if (count > most) refuse(file, fmt::format("its {} has more than {} {}", description_name, most, what));
  };
  check(std::ranges::count(text, '='), attributes_max, "attributes");
  int elements = 0;
  int level = 0;
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at + 1)) {
    const std::string_view rest = std::string_view(text).substr(at);
    if (rest.starts_with("<!--") || rest.starts_with("<![CDATA[") || rest.starts_with("<?")) {
      at = text.find(rest[1] == '?' ? "?>" : rest[2] == '-' ? "-->" : "]]>", at);
    } else if (rest.starts_with("</")) {
      --level;
    } else if (!rest.starts_with("<!")) {
      const std::size_t end = end_of_tag(rest);
      check(++elements, elements_max, "elements");
      if (rest[end - 1] != '/') check(++level, levels_max, "levels of elements");
      at += end;
    }
    if (at >= text.size()) return;
  }
}

/// The number of entries as the archive's last record gives it, before the archive is read. libzip makes all entries.
void check_count(const fs::path& file) {
  constexpr std::streamoff tail = 65'535 + 22;
  constexpr std::size_t count_at = 10;
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  in.seekg(-std::min<std::streamoff>(in.tellg(), tail), std::ios::end);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  for (std::size_t at = text.find("PK\5\6"); at < text.size(); at = text.find("PK\5\6", at + 1)) {
    if (at + count_at + 1 >= text.size()) return;
    const auto byte = [&](std::size_t n) { return static_cast<unsigned>(static_cast<unsigned char>(text[at + n])); };
    const unsigned count = byte(count_at) | byte(count_at + 1) << 8U;
    if (count > entries_max) refuse(file, fmt::format("{} files; an FMU here has at most {}", count, entries_max));
  }
}

}  // namespace

ExtractedFmu::ExtractedFmu() {
  std::string name = (temporary_folder() / "abs_hil_fmu.XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) refuse_temporary(name, errno);
  folder_ = name;
}

// A constructor that ends by an exception after the other one has returned calls the destructor.
ExtractedFmu::ExtractedFmu(const fs::path& file) : ExtractedFmu() {
  // What is no file is not read: a folder cannot be, and a pipe would keep the program waiting.
  if (fs::exists(file) && !fs::is_regular_file(file)) refuse(file, "not an FMU: it is no regular file");
  check_count(file);
  int code = 0;
  const std::unique_ptr<zip_t, Closer> archive(zip_open(file.c_str(), ZIP_RDONLY, &code));
  if (!archive) {
    zip_error_t reason;
    zip_error_init_with_code(&reason, code);
    const std::string text = zip_error_strerror(&reason);
    zip_error_fini(&reason);
    refuse(file,
           "not an FMU: it cannot be read as a zip archive: " + rig::refusal(text, file, "give the file of an FMU"));
  }
  const std::vector<Entry> entries = entries_of(file, archive.get());
  // The description first: what it shows to be hostile is refused before the rest is unpacked.
  const auto description = std::ranges::find(entries, description_name, &Entry::name);
  extract(file, archive.get(), *description, folder_ / description_name);
  check_description(file, folder_ / description_name);
  for (const Entry& entry : entries) {
    if (entry.name != description_name) extract(file, archive.get(), entry, folder_ / entry.name);
  }
}

ExtractedFmu::~ExtractedFmu() {
  std::error_code error;
  fs::remove_all(folder_, error);
}

}  // namespace abs_hil::interchange
