#include "interchange/elf_library.hpp"

#include <elf.h>
#include <fmt/format.h>

#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "interchange/refused_file.hpp"

namespace abs_hil::interchange {

namespace {

#if defined(__x86_64__)
constexpr std::uint16_t this_machine = EM_X86_64;
#elif defined(__aarch64__)
constexpr std::uint16_t this_machine = EM_AARCH64;
#else
constexpr std::uint16_t this_machine = EM_NONE;
#endif

/// Larger than any controller, small enough to read whole.
constexpr std::uintmax_t size_max = std::uintmax_t{256} << 20U;

[[noreturn]] void refuse_damaged(const std::filesystem::path& file) {
  refuse(file, "damaged: its tables point outside of the file; build or copy it again");
}

std::vector<std::uint8_t> read(const std::filesystem::path& file) {
  std::error_code error;
  const bool regular = std::filesystem::is_regular_file(file, error);
  const std::uintmax_t size = regular ? std::filesystem::file_size(file, error) : 0;
  if (error) refuse(file, error.message());
  if (!regular) refuse(file, "not a file; give a shared library");
  if (size > size_max) refuse(file, fmt::format("{} bytes; a controller has at most {}", size, size_max));
  std::vector<std::uint8_t> bytes(size);
  std::ifstream in(file, std::ios::binary);
  if (!in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size))) {
    refuse(file, "cannot be read: " + std::string(std::strerror(errno)));
  }
  return bytes;
}

/// Part `index` of a table in the file.
template <class Entry>
Entry entry_at(const std::filesystem::path& file, std::span<const std::uint8_t> bytes, std::uint64_t offset,
               std::uint64_t index) {
  Entry entry{};
  if (offset > bytes.size() || index > (bytes.size() - offset) / sizeof(Entry) ||
      (index + 1) * sizeof(Entry) > bytes.size() - offset) {
    refuse_damaged(file);
  }
  std::memcpy(&entry, bytes.data() + offset + index * sizeof(Entry), sizeof(Entry));
  return entry;
}

Elf64_Ehdr header_of(const std::filesystem::path& file, std::span<const std::uint8_t> bytes) {
  if (bytes.size() < sizeof(Elf64_Ehdr) || std::memcmp(bytes.data(), ELFMAG, SELFMAG) != 0) {
    refuse(file, "not a shared library of Linux (ELF); build it with cc -shared -fPIC");
  }
  const auto header = entry_at<Elf64_Ehdr>(file, bytes, 0, 0);
  const bool fits = header.e_ident[EI_CLASS] == ELFCLASS64 && header.e_machine == this_machine &&
                    header.e_ident[EI_DATA] == (std::endian::native == std::endian::little ? ELFDATA2LSB : ELFDATA2MSB);
  if (!fits) refuse(file, "built for another kind of processor; build it on this computer");
  if (header.e_type != ET_DYN) refuse(file, "not a shared library; build it with cc -shared -fPIC");
  if (header.e_shnum == 0 || header.e_shentsize != sizeof(Elf64_Shdr)) {
    refuse(file, "it has no table of sections, so its symbols cannot be checked; do not strip that table");
  }
  return header;
}

}  // namespace

ElfLibrary::ElfLibrary(const std::filesystem::path& file) : bytes_(read(file)) {
  const Elf64_Ehdr header = header_of(file, bytes_);
  const auto section = [&](std::uint64_t n) {
    if (n >= header.e_shnum) refuse_damaged(file);
    return entry_at<Elf64_Shdr>(file, bytes_, header.e_shoff, n);
  };
  for (std::uint64_t n = 0; n < header.e_shnum; ++n) {
    const Elf64_Shdr table = section(n);
    if (table.sh_type != SHT_DYNSYM) continue;
    const Elf64_Shdr names = section(table.sh_link);
    if (names.sh_offset > bytes_.size() || names.sh_size > bytes_.size() - names.sh_offset || names.sh_size == 0) {
      refuse_damaged(file);
    }
    const auto* texts = reinterpret_cast<const char*>(bytes_.data() + names.sh_offset);
    for (std::uint64_t i = 0; i < table.sh_size / sizeof(Elf64_Sym); ++i) {
      const auto symbol = entry_at<Elf64_Sym>(file, bytes_, table.sh_offset, i);
      const unsigned type = ELF64_ST_TYPE(symbol.st_info);
      const bool function = type == STT_FUNC;
      if (symbol.st_shndx == SHN_UNDEF || symbol.st_shndx >= header.e_shnum || (!function && type != STT_OBJECT))
        continue;
      if (symbol.st_name >= names.sh_size) refuse_damaged(file);
      const Elf64_Shdr home = section(symbol.st_shndx);
      Symbol found{.function = function};
      if (!function && home.sh_type == SHT_PROGBITS && symbol.st_value >= home.sh_addr) {
        found.offset = symbol.st_value - home.sh_addr + home.sh_offset;
        found.size = symbol.st_size;
        if (found.offset > bytes_.size() || found.size > bytes_.size() - found.offset) refuse_damaged(file);
      }
      const char* name = texts + symbol.st_name;
      symbols_.emplace(std::string(name, ::strnlen(name, names.sh_size - symbol.st_name)), found);
    }
  }
}

bool ElfLibrary::has_function(std::string_view name) const {
  const auto at = symbols_.find(name);
  return at != symbols_.end() && at->second.function;
}

bool ElfLibrary::has_object(std::string_view name) const {
  const auto at = symbols_.find(name);
  return at != symbols_.end() && !at->second.function;
}

std::span<const std::uint8_t> ElfLibrary::object(std::string_view name) const {
  const auto at = symbols_.find(name);
  if (at == symbols_.end() || at->second.function) return {};
  return std::span(bytes_).subspan(at->second.offset, at->second.size);
}

}  // namespace abs_hil::interchange
