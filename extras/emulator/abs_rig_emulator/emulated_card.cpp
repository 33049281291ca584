// The emulated RT-DAC4/PCI as files: a tree like sysfs', which FUSE shows, and the registers behind it.
#define FUSE_USE_VERSION 31
#include <fmt/format.h>
#include <fuse.h>
#include <fuse_lowlevel.h>
#include <spawn.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "control.hpp"
#include "emulator/card_model.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

namespace {

/// In lock-step: the card's time, ns, 8 bytes.
constexpr const char* time_file = "emulated_time_ns";

/// One file of the tree below the card's folder.
struct ServedFile {
  std::string name;
  std::string content{};   ///< of a read-only text file
  std::uint64_t bytes{0};  ///< size of a file of registers: reads and writes go to the card, one access each

  [[nodiscard]] bool registers() const { return content.empty(); }
};

/// The files of sysfs that a driver reads.
std::vector<ServedFile> files_of(const EmulatorOptions& options) {
  constexpr std::uint64_t bar_start = 0xE000;
  const std::string flags = options.bar_kind == "io" ? "0x0000000000040101" : "0x0000000000040200";
  const std::string none = "0x0000000000000000 0x0000000000000000 0x0000000000000000\n";
  const std::string bar2 = fmt::format("0x{:016x} 0x{:016x} {}\n", bar_start, bar_start + options.bar_bytes - 1, flags);
  std::vector<ServedFile> files{{.name = "vendor", .content = options.vendor + "\n"},
                                {.name = "device", .content = options.device + "\n"},
                                {.name = "class", .content = "0x068000\n"},
                                {.name = "enable", .content = "1\n"},
                                {.name = "resource", .content = none + none + bar2 + none + none + none + none},
                                {.name = "resource2", .bytes = options.bar_bytes}};
  if (options.board.lock_step) files.push_back({.name = time_file, .bytes = 8});
  return files;
}

/// What a path names: the root, a card's folder, or a file in it.
struct Named {
  bool exists{false};
  bool behind{false};               ///< the card is behind the folder
  const ServedFile* file{nullptr};  ///< null: a folder
};

void wait_for(std::int64_t duration_ns) {
  runtime::MonotonicClock clock;
  clock.sleep_until(clock.now_ns() + duration_ns);
}

/// Unmounts `root` if an emulator that was killed left it mounted: every access to such a mount fails with ENOTCONN.
void detach_dead_mount(const std::string& root) {
  struct stat folder {};
  if (stat(root.c_str(), &folder) == 0 || errno != ENOTCONN) return;
  if (umount2(root.c_str(), MNT_DETACH) == 0) return;
  // Without root's rights only fuse3's helper may unmount.
  std::array<char*, 4> words{const_cast<char*>("fusermount3"), const_cast<char*>("-uz"),
                             const_cast<char*>(root.c_str()), nullptr};
  pid_t helper{};
  int status{-1};
  if (posix_spawnp(&helper, words[0], nullptr, nullptr, words.data(), environ) == 0) waitpid(helper, &status, 0);
  if (status != 0)
    throw std::runtime_error("a killed emulator left a dead mount at " + root + ": run fusermount3 -uz " + root);
}

/// Creates the folder of the tree before anything else: the other files are often beside it, in the same new one.
const EmulatorOptions& with_folder(const EmulatorOptions& options) {
  detach_dead_mount(options.pci_root);
  std::filesystem::create_directories(options.pci_root);
  return options;
}

/// A folder with one folder per card, of which only the first has the card behind it; all have the same files. Text
/// files are like those of sysfs. Every access to a file of registers goes to the card, uncached (direct_io), in the
/// caller's thread. The answers to FUSE are -errno, or the number of bytes read or written.
class EmulatedCard final : public BoardOf<EmulatedCard> {
 public:
  /// Mounts the tree at `pci_root`, an empty folder that is created if it is missing.
  explicit EmulatedCard(const EmulatorOptions& options)
      : BoardOf(with_folder(options), true),
        model_(options.board),
        faulty_(model_, options.seed),
        root_(options.pci_root),
        folders_(options.bdfs),
        files_(files_of(options)) {
    if (!options.traffic_file.empty()) traffic_.begin(options.traffic_file);
    mount();
  }
  ~EmulatedCard() override {
    fuse_unmount(tree_);
    fuse_destroy(tree_);
    free(buffer_.mem);
  }

  [[nodiscard]] int descriptor() const override { return fuse_session_fd(fuse_get_session(tree_)); }
  bool serve() override {
    fuse_session* session = fuse_get_session(tree_);
    const int got = fuse_session_receive_buf(session, &buffer_);
    if (got == -EINTR || got == -EAGAIN) return true;
    if (got <= 0) return false;  // it has been unmounted from outside
    fuse_session_process_buf(session, &buffer_);
    return fuse_session_exited(session) == 0;
  }
  [[nodiscard]] std::string status() const override {
    return fmt::format("{}, trip flags {:#x}", state_text(model_), model_.trip_flags());
  }
  [[nodiscard]] std::string place() const override { return "card " + folders_.front() + " in " + root_; }
  [[nodiscard]] static std::span<const ControlRow<EmulatedCard>> rows() {
    using Card = EmulatedCard;
    using Command = ControlCommand;
    static constexpr std::array<ControlRow<Card>, 13> all{{
        {"fault OFFSET:KIND[=PARAMETER]", "one register: ok stuck wrong= slow= delayed= intermittent= off garbage",
         [](Card& card, const Command& c) { card.faulty_.set(c.text(1)); }},
        {"unplug", "the card's files disappear", [](Card& card, const Command&) { card.present_ = false; }},
        {"plug", "they reappear", [](Card& card, const Command&) { card.present_ = true; }},
        {"all-ones on|off", "the card leaves the bus, its files stay",
         [](Card& card, const Command& c) { card.faulty_.answer_all_ones(c.on(1)); }},
        {"deny on|off", "opening the registers is forbidden",
         [](Card& card, const Command& c) { card.permission_denied_ = c.on(1); }},
        estop_row<Card>,
        supply_row<Card>,
        temperature_row<Card>,
        overspeed_row<Card>,
        turn_row<Card>,
        {"record FILE|off", "register accesses: R or W, offset, value",
         [](Card& card, const Command& c) { card.traffic_.begin(c.text(1)); }},
        {"changes FILE|off", "each change of a PWM's width: when, ns as in \"widths\", drive, brake",
         [](Card& card, const Command& c) { card.changes_.begin(c.text(1)); }},
        {.usage = "widths",
         .meaning =
             "both PWM width registers, since when both are 0, time of the last write; ns of CLOCK_MONOTONIC, in "
             "lock-step of the card's time",
         .answer = &Card::widths},
    }};
    return all;
  }
  [[nodiscard]] emulator::CardModel& model() noexcept { return model_; }

  // For FUSE.
  [[nodiscard]] Named named(std::string_view path) const {
    if (path == "/") return {.exists = true};
    path.remove_prefix(1);
    const std::size_t slash = path.find('/');
    const auto folder = std::ranges::find(folders_, path.substr(0, slash));
    if (folder == folders_.end() || !is_there(folder)) return {};
    if (slash == std::string_view::npos) return {.exists = true};
    const auto file = std::ranges::find(files_, path.substr(slash + 1), &ServedFile::name);
    if (file == files_.end()) return {};
    return {.exists = true, .behind = folder == folders_.begin(), .file = &*file};
  }
  template <typename Use>
  void for_each_name_in(std::string_view path, Use use) const {
    if (path != "/") std::ranges::for_each(files_, use, &ServedFile::name);
    for (auto folder = folders_.begin(); path == "/" && folder != folders_.end(); ++folder) {
      if (is_there(folder)) use(*folder);
    }
  }
  [[nodiscard]] int open() const { return permission_denied_ ? -EACCES : 0; }
  /// One access of `size` bytes; `value` is what is written, or becomes what is read.
  [[nodiscard]] int access(bool write, const ServedFile& file, off_t offset, std::size_t size, std::uint64_t& value) {
    if (file.name == time_file) {
      if (offset != 0 || size != sizeof value) return -EINVAL;
      if (write) time_.advance(model_, static_cast<std::int64_t>(value));
      value = static_cast<std::uint64_t>(model_.time_ns());
      return sizeof value;
    }
    // The kernel splits other sizes into 1- and 2-byte port accesses, which the card does not have.
    if (size != sizeof(std::uint32_t) || offset % 4 != 0 || offset >= emulator::CardModel::bytes) return -EINVAL;
    catch_up();
    const auto at = static_cast<std::uint32_t>(offset);
    const emulator::AccessResult result =
        write ? faulty_.write32(at, static_cast<std::uint32_t>(value)) : faulty_.read32(at);
    if (result.delay_ns > 0) wait_for(result.delay_ns);
    if (result.failed) return -EIO;
    if (!write) value = result.value;
    if (traffic_.is_open()) traffic_ << fmt::format("{} {:02X} {:08x}\n", write ? 'W' : 'R', at, value);
    if (write && changes_.is_open()) note_change();
    return sizeof(std::uint32_t);
  }

 private:
  void mount();
  /// False: the card is unplugged and its folder is gone.
  [[nodiscard]] bool is_there(std::vector<std::string>::const_iterator folder) const {
    return folder != folders_.begin() || present_;
  }
  void note_change() {
    const emulator::PwmWidths& w = model_.pwm_widths();
    const std::pair now{w.drive, w.brake};
    if (std::exchange(last_widths_, now) == now) return;
    changes_ << fmt::format("{} {} {}\n", time_.start_ns() + w.last_written_ns, w.drive, w.brake);
  }
  /// Both PWMs' width registers and their times, as one line.
  [[nodiscard]] std::string widths() const {
    const emulator::PwmWidths& w = model_.pwm_widths();
    const auto text = [&](std::int64_t time_ns) { return fmt::format("{} ns", time_.start_ns() + time_ns); };
    return fmt::format("drive {}, brake {}, {}, last written at {}", w.drive, w.brake,
                       w.drive == 0 && w.brake == 0 ? "both 0 since " + text(w.zero_since_ns) : "not both 0",
                       text(w.last_written_ns));
  }

  emulator::CardModel model_;
  emulator::FaultyCard faulty_;
  bool present_{true};
  bool permission_denied_{false};
  OutputFile traffic_{};
  std::pair<std::uint32_t, std::uint32_t> last_widths_{};
  std::string root_;
  std::vector<std::string> folders_;
  std::vector<ServedFile> files_;
  fuse* tree_{nullptr};
  fuse_buf buffer_{};
};

EmulatedCard& card() { return *static_cast<EmulatedCard*>(fuse_get_context()->private_data); }

int on_getattr(const char* path, struct stat* out, fuse_file_info* /*info*/) {
  const Named what = card().named(path);
  if (!what.exists) return -ENOENT;
  *out = {};
  out->st_uid = getuid();
  out->st_gid = getgid();
  out->st_nlink = what.file == nullptr ? 2 : 1;
  out->st_mode = what.file == nullptr ? S_IFDIR | 0755 : S_IFREG | (what.file->registers() ? 0600 : 0444);
  if (what.file != nullptr) {
    out->st_size = static_cast<off_t>(what.file->registers() ? what.file->bytes : what.file->content.size());
  }
  return 0;
}

int on_readdir(const char* path, void* buffer, fuse_fill_dir_t fill, off_t /*offset*/, fuse_file_info* /*info*/,
               fuse_readdir_flags /*flags*/) {
  if (!card().named(path).exists) return -ENOENT;
  const auto show = [&](const std::string& name) { fill(buffer, name.c_str(), nullptr, 0, fuse_fill_dir_flags{}); };
  show(".");
  show("..");
  card().for_each_name_in(path, show);
  return 0;
}

int on_open(const char* path, fuse_file_info* info) {
  const Named what = card().named(path);
  if (what.file == nullptr) return -ENOENT;
  info->direct_io = 1;
  return what.file->registers() ? card().open() : 0;
}

int on_read(const char* path, char* data, size_t size, off_t offset, fuse_file_info* /*info*/) {
  const Named what = card().named(path);
  if (what.file == nullptr) return -ENODEV;  // the card was unplugged while the file was open
  if (!what.file->registers()) {
    const std::string& content = what.file->content;
    return static_cast<int>(content.copy(data, size, std::min(static_cast<std::size_t>(offset), content.size())));
  }
  std::uint64_t value = 0;
  const int done = what.behind ? card().access(false, *what.file, offset, size, value) : -EIO;
  if (done > 0) std::memcpy(data, &value, static_cast<std::size_t>(done));
  return done;
}

int on_write(const char* path, const char* data, size_t size, off_t offset, fuse_file_info* /*info*/) {
  const Named what = card().named(path);
  if (what.file == nullptr) return -ENODEV;
  if (!what.file->registers() || !what.behind) return -EACCES;
  std::uint64_t value = 0;
  std::memcpy(&value, data, std::min(size, sizeof value));
  return card().access(true, *what.file, offset, size, value);
}

/// The kernel must cache nothing, so that an unplugged card disappears at once. Pipes make accesses of four bytes slow.
void* on_init(fuse_conn_info* connection, fuse_config* config) {
  connection->want &= ~static_cast<unsigned>(FUSE_CAP_SPLICE_READ);
  config->entry_timeout = config->attr_timeout = config->negative_timeout = 0.0;
  return fuse_get_context()->private_data;
}

fuse_operations operations() {
  fuse_operations ops{};
  ops.init = on_init;
  ops.getattr = on_getattr;
  ops.readdir = on_readdir;
  ops.open = on_open;
  ops.read = on_read;
  ops.write = on_write;
  // O_TRUNC, touch, chgrp: taken, and nothing changes.
  ops.truncate = [](const char*, off_t, fuse_file_info*) { return 0; };
  ops.utimens = [](const char*, const timespec*, fuse_file_info*) { return 0; };
  ops.chmod = [](const char*, mode_t, fuse_file_info*) { return 0; };
  ops.chown = [](const char*, uid_t, gid_t, fuse_file_info*) { return 0; };
  return ops;
}

void EmulatedCard::mount() {
  std::array<char*, 4> words{const_cast<char*>("abs_rig_emulator"), const_cast<char*>("-o"),
                             const_cast<char*>("fsname=abs_rig_emulator"), nullptr};
  fuse_args arguments = FUSE_ARGS_INIT(3, words.data());
  static const fuse_operations ops = operations();
  tree_ = fuse_new(&arguments, &ops, sizeof ops, this);
  fuse_opt_free_args(&arguments);
  if (tree_ != nullptr && fuse_mount(tree_, root_.c_str()) == 0) return;
  if (tree_ != nullptr) fuse_destroy(tree_);
  throw std::runtime_error(
      "cannot mount a FUSE tree at " + root_ +
      ": it needs /dev/fuse (sudo modprobe fuse), the package fuse3, and an empty folder that you own");
}

}  // namespace

BoardKind card_kind() { return kind_of<EmulatedCard>("a card"); }

}  // namespace abs_hil::program
