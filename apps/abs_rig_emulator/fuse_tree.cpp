#include "fuse_tree.hpp"

#define FUSE_USE_VERSION 31
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

namespace abs_hil::program {

struct FuseTree::State {
  std::vector<std::string> folders;
  std::vector<ServedFile> files;
  FileHandler* handler{nullptr};
  fuse_session* session{nullptr};
  fuse_buf buffer{};
};

namespace {

// Inodes: 1 the root; folder f is 2 + f; file i of folder f is first_file + f * files_per_folder + i.
constexpr fuse_ino_t first_folder = 2;
constexpr fuse_ino_t first_file = 1000;
constexpr fuse_ino_t files_per_folder = 100;
/// The kernel must cache nothing, so that an unplugged card disappears at once.
constexpr double no_caching = 0.0;

FuseTree::State& state_of(fuse_req_t request) { return *static_cast<FuseTree::State*>(fuse_req_userdata(request)); }

bool is_there(const FuseTree::State& s, std::size_t folder) {
  return folder < s.folders.size() && (folder != 0 || s.handler->present());
}

/// The file behind an inode; null if there is none, or if the card is gone.
const ServedFile* file_of(const FuseTree::State& s, fuse_ino_t inode) {
  if (inode < first_file) return nullptr;
  const std::size_t folder = (inode - first_file) / files_per_folder;
  const std::size_t file = (inode - first_file) % files_per_folder;
  return is_there(s, folder) && file < s.files.size() ? &s.files[file] : nullptr;
}
bool is_first_folder(fuse_ino_t inode) { return inode < first_file + files_per_folder; }

bool attributes(const FuseTree::State& s, fuse_ino_t inode, struct stat& out) {
  out = {};
  out.st_ino = inode;
  out.st_uid = getuid();
  out.st_gid = getgid();
  if (inode == FUSE_ROOT_ID || (inode < first_file && is_there(s, inode - first_folder))) {
    out.st_mode = S_IFDIR | 0755;
    out.st_nlink = 2;
    return true;
  }
  const ServedFile* file = file_of(s, inode);
  if (file == nullptr) return false;
  out.st_mode = S_IFREG | static_cast<mode_t>(file->mode);
  out.st_nlink = 1;
  out.st_size = static_cast<off_t>(file->registers ? file->bytes : file->content.size());
  return true;
}

void on_lookup(fuse_req_t request, fuse_ino_t parent, const char* name) {
  const FuseTree::State& s = state_of(request);
  fuse_ino_t inode = 0;
  if (parent == FUSE_ROOT_ID) {
    const auto found = std::find(s.folders.begin(), s.folders.end(), name);
    if (found != s.folders.end()) inode = first_folder + static_cast<fuse_ino_t>(found - s.folders.begin());
  } else if (parent < first_file) {
    const auto found = std::find_if(s.files.begin(), s.files.end(), [&](const auto& f) { return f.name == name; });
    if (found != s.files.end()) {
      inode =
          first_file + (parent - first_folder) * files_per_folder + static_cast<fuse_ino_t>(found - s.files.begin());
    }
  }
  fuse_entry_param entry{};
  if (inode == 0 || !attributes(s, inode, entry.attr)) {
    fuse_reply_err(request, ENOENT);
    return;
  }
  entry.ino = inode;
  entry.attr_timeout = entry.entry_timeout = no_caching;
  fuse_reply_entry(request, &entry);
}

void on_getattr(fuse_req_t request, fuse_ino_t inode, fuse_file_info* /*info*/) {
  struct stat out {};
  if (attributes(state_of(request), inode, out)) {
    fuse_reply_attr(request, &out, no_caching);
  } else {
    fuse_reply_err(request, ENOENT);
  }
}

/// Called for O_TRUNC and `touch`: changes nothing.
void on_setattr(fuse_req_t request, fuse_ino_t inode, struct stat* /*wanted*/, int /*which*/, fuse_file_info* info) {
  on_getattr(request, inode, info);
}

void on_readdir(fuse_req_t request, fuse_ino_t inode, size_t size, off_t offset, fuse_file_info* /*info*/) {
  const FuseTree::State& s = state_of(request);
  std::vector<std::pair<std::string, fuse_ino_t>> entries{{".", inode}, {"..", FUSE_ROOT_ID}};
  if (inode == FUSE_ROOT_ID) {
    for (std::size_t i = 0; i < s.folders.size(); ++i) {
      if (is_there(s, i)) entries.emplace_back(s.folders[i], first_folder + i);
    }
  } else if (inode < first_file && is_there(s, inode - first_folder)) {
    const fuse_ino_t base = first_file + (inode - first_folder) * files_per_folder;
    for (std::size_t i = 0; i < s.files.size(); ++i) entries.emplace_back(s.files[i].name, base + i);
  }
  std::vector<char> buffer(size);
  std::size_t used = 0;
  for (auto i = static_cast<std::size_t>(offset); i < entries.size(); ++i) {
    struct stat out {};
    static_cast<void>(attributes(s, entries[i].second, out));
    const std::size_t needed = fuse_add_direntry(request, buffer.data() + used, size - used, entries[i].first.c_str(),
                                                 &out, static_cast<off_t>(i + 1));
    if (needed > size - used) break;
    used += needed;
  }
  fuse_reply_buf(request, buffer.data(), used);
}

void on_open(fuse_req_t request, fuse_ino_t inode, fuse_file_info* info) {
  const FuseTree::State& s = state_of(request);
  const ServedFile* file = file_of(s, inode);
  const int result = file == nullptr ? -ENOENT : (file->registers ? s.handler->open(file->name) : 0);
  if (result < 0) {
    fuse_reply_err(request, -result);
    return;
  }
  info->direct_io = 1;
  fuse_reply_open(request, info);
}

void on_read(fuse_req_t request, fuse_ino_t inode, size_t size, off_t offset, fuse_file_info* /*info*/) {
  const FuseTree::State& s = state_of(request);
  const ServedFile* file = file_of(s, inode);
  if (file == nullptr) {
    fuse_reply_err(request, ENODEV);  // the card was unplugged while the file was open
    return;
  }
  const auto at = static_cast<std::size_t>(offset);
  if (!file->registers) {
    const std::string_view rest = std::string_view(file->content).substr(std::min(at, file->content.size()), size);
    fuse_reply_buf(request, rest.data(), rest.size());
    return;
  }
  std::array<char, 8> word{};
  const int result = is_first_folder(inode) ? s.handler->read(file->name, at, word.data(), std::min(size, word.size()))
                                            : -EIO;  // a folder without a card behind it
  if (result < 0) {
    fuse_reply_err(request, -result);
  } else {
    fuse_reply_buf(request, word.data(), static_cast<std::size_t>(result));
  }
}

void on_write(fuse_req_t request, fuse_ino_t inode, const char* data, size_t size, off_t offset,
              fuse_file_info* /*info*/) {
  const FuseTree::State& s = state_of(request);
  const ServedFile* file = file_of(s, inode);
  if (file == nullptr) {
    fuse_reply_err(request, ENODEV);
    return;
  }
  const int result = file->registers && is_first_folder(inode)
                         ? s.handler->write(file->name, static_cast<std::size_t>(offset), data, size)
                         : -EACCES;
  if (result < 0) {
    fuse_reply_err(request, -result);
  } else {
    fuse_reply_write(request, static_cast<std::size_t>(result));
  }
}

fuse_lowlevel_ops operations() {
  fuse_lowlevel_ops ops{};
  ops.lookup = on_lookup;
  ops.getattr = on_getattr;
  ops.setattr = on_setattr;
  ops.readdir = on_readdir;
  ops.open = on_open;
  ops.read = on_read;
  ops.write = on_write;
  return ops;
}

/// Takes away what an emulator that was killed leaves at `root`: a mount that answers nothing but ENOTCONN.
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

}  // namespace

void prepare_mount_folder(const std::string& root) {
  detach_dead_mount(root);
  std::filesystem::create_directories(root);
}

FuseTree::FuseTree(const std::string& root, std::vector<std::string> folders, std::vector<ServedFile> files,
                   FileHandler& handler)
    : state_(new State{std::move(folders), std::move(files), &handler, nullptr, {}}) {
  std::array<char*, 4> words{const_cast<char*>("abs_rig_emulator"), const_cast<char*>("-o"),
                             const_cast<char*>("fsname=abs_rig_emulator"), nullptr};
  fuse_args arguments = FUSE_ARGS_INIT(3, words.data());
  static const fuse_lowlevel_ops ops = operations();
  state_->session = fuse_session_new(&arguments, &ops, sizeof ops, state_);
  fuse_opt_free_args(&arguments);
  if (state_->session == nullptr || fuse_session_mount(state_->session, root.c_str()) != 0) {
    if (state_->session != nullptr) fuse_session_destroy(state_->session);
    delete state_;
    throw std::runtime_error(
        "cannot mount a FUSE tree at " + root +
        ": it needs /dev/fuse (sudo modprobe fuse), the package fuse3, and an empty folder that you own");
  }
}

FuseTree::~FuseTree() {
  fuse_session_unmount(state_->session);
  fuse_session_destroy(state_->session);
  free(state_->buffer.mem);
  delete state_;
}

int FuseTree::descriptor() const { return fuse_session_fd(state_->session); }

bool FuseTree::serve_one() {
  const int got = fuse_session_receive_buf(state_->session, &state_->buffer);
  if (got == -EINTR || got == -EAGAIN) return true;
  if (got <= 0) return false;
  fuse_session_process_buf(state_->session, &state_->buffer);
  return fuse_session_exited(state_->session) == 0;
}

}  // namespace abs_hil::program
