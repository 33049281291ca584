#include "run_folder/csv_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "abs_hil/rig/quantities.hpp"
#include "run_folder/clean_text.hpp"
#include "run_folder/input_error.hpp"

namespace abs_hil::run_folder {

namespace {

constexpr std::size_t csv_block_bytes = 1U << 20U;
/// Rows of a run are much shorter. A file with a longer line is not a run's CSV.
constexpr std::size_t longest_line_bytes = 65'536;
constexpr std::size_t shown_characters = 40;
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

std::string_view without_return(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

/// Removes and returns the field before the next comma of `line`.
std::string_view take_field(std::string_view& line, bool& more) {
  const std::size_t comma = line.find(',');
  const std::string_view field = line.substr(0, comma);
  more = comma != std::string_view::npos;
  line.remove_prefix(more ? comma + 1 : line.size());
  return field;
}

}  // namespace

const std::vector<std::string>& contract_columns() {
  static const std::vector<std::string> columns = [] {
    std::vector<std::string> names;
    rig::for_each_quantity([&names](const auto& row) {
      if (row.in_csv() && row.since == rig::first_version) names.emplace_back(row.name);
    });
    return names;
  }();
  return columns;
}

CsvReader::CsvReader(std::filesystem::path path)
    : path_(std::move(path)), buffer_(csv_block_bytes), last_time_s_(-std::numeric_limits<double>::infinity()) {
  do {
    file_ = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  } while (file_ < 0 && errno == EINTR);
  if (file_ < 0) {
    throw InputError(
        fmt::format("cannot read \"{}\": {}; give a run's CSV file or folder", path_.string(), std::strerror(errno)));
  }
  try {
    read_header();
  } catch (...) {
    ::close(file_);
    throw;
  }
}

CsvReader::~CsvReader() { ::close(file_); }

std::optional<std::size_t> CsvReader::find(std::string_view column) const noexcept {
  const auto found = std::find(columns_.begin(), columns_.end(), column);
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

std::size_t CsvReader::column(std::string_view name) const {
  const auto found = find(name);
  if (!found) {
    throw InputError(
        path_, 1,
        fmt::format("no column \"{}\"; the file has the columns {}", clean_text(name), fmt::join(columns_, ", ")));
  }
  return *found;
}

void CsvReader::refill() {
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_), buffer_.begin() + static_cast<std::ptrdiff_t>(end_),
            buffer_.begin());
  end_ -= begin_;
  begin_ = 0;
  const ssize_t got = ::read(file_, buffer_.data() + end_, buffer_.size() - end_);
  if (got > 0) {
    end_ += static_cast<std::size_t>(got);
  } else if (got == 0) {
    at_end_ = true;
  } else if (errno != EINTR) {
    throw InputError(path_, line_ + 1, fmt::format("cannot read the next line: {}", std::strerror(errno)));
  }
}

bool CsvReader::next_line(std::string_view& line) {
  std::size_t searched = 0;
  while (true) {
    const char* begin = buffer_.data() + begin_;
    const std::size_t size = end_ - begin_;
    const void* found = std::memchr(begin + searched, '\n', size - searched);
    if (found != nullptr) {
      const auto length = static_cast<std::size_t>(static_cast<const char*>(found) - begin);
      line = without_return({begin, length});
      begin_ += length + 1;
      ++line_;
      return true;
    }
    if (size > longest_line_bytes) {
      throw InputError(path_, line_ + 1,
                       "the line is longer than any row of a run; give a CSV file that abs_hil wrote");
    }
    if (at_end_) {
      truncated_ = size > 0;
      return false;
    }
    searched = size;
    refill();
  }
}

void CsvReader::read_header() {
  std::string_view line;
  if (!next_line(line)) {
    throw InputError(path_, 1,
                     truncated_ ? "the file ends within its first line: the recording stopped before the first row"
                                : "the file is empty: the run wrote nothing");
  }
  if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);  // a spreadsheet's byte order mark
  bool more = true;
  while (more) columns_.emplace_back(take_field(line, more));
  std::string missing;
  for (const std::string& name : contract_columns()) {
    if (!find(name)) missing += (missing.empty() ? "" : ", ") + name;
  }
  if (!missing.empty()) {
    throw InputError(path_, 1,
                     fmt::format("the header lacks {}; a run's CSV, as abs_hil --csv writes it, begins with \"{},…\"",
                                 missing, fmt::join(contract_columns().begin(), contract_columns().begin() + 3, ",")));
  }
  for (std::string& name : columns_) name = clean_text(name);
  values_.resize(columns_.size());
  time_column_ = *find("time_s");
  phase_column_ = *find("phase");
  phase_name_column_ = find(phase_name_column);
}

bool CsvReader::next() {
  std::string_view line;
  if (!next_line(line)) return false;
  read_row(line);
  return true;
}

void CsvReader::read_row(std::string_view line) {
  bool more = true;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (!more) {
      throw InputError(
          path_, line_,
          fmt::format("the row has {} fields instead of {} and ends before {}", i, columns_.size(), columns_[i]));
    }
    const std::string_view field = take_field(line, more);
    if (i == phase_column_) {
      phase_.assign(field.substr(0, shown_characters));
      values_[i] = no_number;
      continue;
    }
    if (i == phase_name_column_) {
      phase_name_.assign(field.substr(0, shown_characters));
      values_[i] = no_number;
      continue;
    }
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), values_[i]);
    if (error != std::errc{} || end != field.data() + field.size()) {
      throw InputError(path_, line_,
                       fmt::format("{}: \"{}\" is not a number (a run writes NaN for an unknown value)", columns_[i],
                                   clean_text(field, shown_characters)));
    }
  }
  if (more) {
    throw InputError(path_, line_, fmt::format("the row has more than the header's {} fields", columns_.size()));
  }
  const double time_s = values_[time_column_];
  if (!std::isfinite(time_s)) throw InputError(path_, line_, "time_s is not a finite number");
  if (time_s < last_time_s_) {
    throw InputError(path_, line_, fmt::format("time_s decreases from {} to {}", last_time_s_, time_s));
  }
  last_time_s_ = time_s;
}

}  // namespace abs_hil::run_folder
