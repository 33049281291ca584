#pragma once

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "files/result_file.hpp"

namespace abs_hil::telemetry {

/// A file that grows record by record while a run goes on, written in blocks of whole records of at most 64 KiB. A
/// write that fails ends the file and not the run: a file that ends early is better than one with a gap.
class RecordFile {
 public:
  /// Throws files::FileError when the file cannot be opened.
  /// @param early  the first write puts the file in its place, so that it survives a killed program; else it appears
  ///               when it is whole
  RecordFile(std::filesystem::path path, std::string kind, bool early)
      : file_(std::in_place, path, kind), path_(std::move(path)), kind_(std::move(kind)), early_(early) {}
  /// An error ended the run: what was recorded stays, without a report of a failure. Without a record an older file
  /// stays.
  ~RecordFile() {
    if (records_ > 0) close();
  }

  /// Puts a text before the first record.
  void begin(std::string_view text) { file_->append(text); }
  /// @param due  the record and those before it must be written now
  void append(std::string_view record, bool due) noexcept {
    ++records_;
    ++unwritten_;
    attempt([&] {
      if (record.size() > file_->room()) write(1);
      file_->append(record);
      if (due) write(0);
    });
  }
  /// Closes the file. Throws files::FileError if any write has failed since the start, as on a full disk.
  void finish() {
    close();
    if (error_number_ != 0) throw files::FileError(kind_, path_, error_number_);
  }
  /// Records that are missing or incomplete in the file.
  [[nodiscard]] std::uint64_t lost() const noexcept { return error_number_ != 0 && !early_ ? records_ : lost_; }

 private:
  void write(std::uint64_t unwritten) {
    file_->flush();
    if (early_) file_->show();
    unwritten_ = unwritten;
  }
  void close() noexcept {
    attempt([this] {
      write(0);
      file_->commit();
    });
    file_.reset();
  }
  template <class Act>
  void attempt(const Act& act) noexcept {
    try {
      if (file_ && error_number_ == 0) return act();
    } catch (const files::FileError& error) {
      error_number_ = error.error_number() != 0 ? error.error_number() : EIO;
    }
    lost_ += std::exchange(unwritten_, 0);
  }

  std::optional<files::ResultFile> file_;
  std::filesystem::path path_;
  std::string kind_;
  bool early_;
  std::uint64_t records_{0};
  std::uint64_t unwritten_{0};  ///< records since the last write
  std::uint64_t lost_{0};
  int error_number_{0};  ///< errno of the first write that failed
};

}  // namespace abs_hil::telemetry
