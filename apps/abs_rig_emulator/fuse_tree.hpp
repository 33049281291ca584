#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::program {

/// One file of the tree below the card's folder.
struct ServedFile {
  std::string name;
  std::string content{};   ///< content of a read-only text file
  std::uint64_t bytes{0};  ///< size of a file of registers
  bool registers{false};   ///< reads and writes go to the handler, one access each
  int mode{0444};
};

/// Interface of the tree to the emulator. Results are -errno, or the number of bytes read or written.
class FileHandler {
 public:
  FileHandler() = default;
  FileHandler(const FileHandler&) = delete;
  FileHandler& operator=(const FileHandler&) = delete;
  virtual ~FileHandler() = default;
  [[nodiscard]] virtual int open(std::string_view name) = 0;
  [[nodiscard]] virtual int read(std::string_view name, std::uint64_t offset, void* data, std::size_t size) = 0;
  [[nodiscard]] virtual int write(std::string_view name, std::uint64_t offset, const void* data, std::size_t size) = 0;
  /// False: the card is unplugged and its folder is gone.
  [[nodiscard]] virtual bool present() const = 0;
};

/// Makes the folder `root` for a FuseTree if it is missing, and takes away the dead mount that a killed emulator left
/// there. Throws std::runtime_error with the cause.
void prepare_mount_folder(const std::string& root);

/// A folder with one folder per card, mounted through FUSE. It has text files like those of sysfs, and files whose
/// every access goes to the handler, uncached (direct_io). It runs in the caller's thread.
class FuseTree {
 public:
  /// Mounts at `root`, an empty folder. Throws std::runtime_error with the cause.
  /// @param folders names of the cards' folders; all have the same files, but only the first has a card behind it
  FuseTree(const std::string& root, std::vector<std::string> folders, std::vector<ServedFile> files,
           FileHandler& handler);
  FuseTree(const FuseTree&) = delete;
  FuseTree& operator=(const FuseTree&) = delete;
  ~FuseTree();  ///< unmounts

  /// Descriptor for poll().
  [[nodiscard]] int descriptor() const;
  /// Answers one waiting request. False once the tree has been unmounted from outside.
  bool serve();

  struct State;

 private:
  std::unique_ptr<State> state_;
};

}  // namespace abs_hil::program
