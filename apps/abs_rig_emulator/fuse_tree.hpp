#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::program {

/// One file of the tree below the card's folder.
struct ServedFile {
  std::string name;
  std::string content{};   ///< of a read-only text file
  std::uint64_t bytes{0};  ///< size to show for a file of registers
  bool registers{false};   ///< reads and writes go to the handler, one access each
  int mode{0444};
};

/// What the tree asks of the emulator. Results are -errno, or the bytes read or written.
class FileHandler {
 public:
  FileHandler() = default;
  FileHandler(const FileHandler&) = delete;
  FileHandler& operator=(const FileHandler&) = delete;
  virtual ~FileHandler() = default;
  [[nodiscard]] virtual int open(std::string_view name) = 0;
  [[nodiscard]] virtual int read(std::string_view name, std::uint64_t offset, void* data, std::size_t size) = 0;
  [[nodiscard]] virtual int write(std::string_view name, std::uint64_t offset, const void* data, std::size_t size) = 0;
  /// False: the card has been pulled out, its folder is gone.
  [[nodiscard]] virtual bool present() const = 0;
};

/// A folder with one folder for each card, mounted through FUSE: files of text like sysfs', and files whose every
/// access goes to the handler, uncached (direct_io). One thread, the caller's.
class FuseTree {
 public:
  /// Mounts at `root`, an empty folder. Throws std::runtime_error with the cause.
  /// @param folders names of the cards' folders; all hold the same files, and the first one is the one behind them
  FuseTree(const std::string& root, std::vector<std::string> folders, std::vector<ServedFile> files,
           FileHandler& handler);
  FuseTree(const FuseTree&) = delete;
  FuseTree& operator=(const FuseTree&) = delete;
  ~FuseTree();  ///< unmounts

  /// To be waited for.
  [[nodiscard]] int descriptor() const;
  /// Answers one request that is there. False once the tree has been unmounted from outside.
  bool serve_one();

  struct State;

 private:
  State* state_;
};

}  // namespace abs_hil::program
