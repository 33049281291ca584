// Answers the kernel's FUSE requests about the folder of an emulated card.
#include "fuse_tree.hpp"

#define FUSE_USE_VERSION 31
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
#include <filesystem>
#include <stdexcept>

namespace abs_hil::program {

struct FuseTree::State {
  std::vector<std::string> folders;
  std::vector<ServedFile> files;
  FileHandler* handler{nullptr};
  fuse* tree{nullptr};
  fuse_buf buffer{};
};

namespace {

const FuseTree::State& state() { return *static_cast<FuseTree::State*>(fuse_get_context()->private_data); }

/// What a path names: the root, a card's folder, or a file in it.
struct Named {
  bool exists{false};
  bool behind{false};               ///< a card is behind the folder
  const ServedFile* file{nullptr};  ///< null: a folder
};

bool is_there(std::size_t folder) { return folder != 0 || state().handler->present(); }

Named named(std::string_view path) {
  const FuseTree::State& s = state();
  if (path == "/") return {.exists = true};
  path.remove_prefix(1);
  const std::size_t slash = path.find('/');
  const auto folder = std::find(s.folders.begin(), s.folders.end(), path.substr(0, slash));
  const auto number = static_cast<std::size_t>(folder - s.folders.begin());
  if (folder == s.folders.end() || !is_there(number)) return {};
  if (slash == std::string_view::npos) return {.exists = true};
  const auto file = std::ranges::find(s.files, path.substr(slash + 1), &ServedFile::name);
  if (file == s.files.end()) return {};
  return {.exists = true, .behind = number == 0, .file = &*file};
}

int on_getattr(const char* path, struct stat* out, fuse_file_info* /*info*/) {
  const Named what = named(path);
  if (!what.exists) return -ENOENT;
  *out = {};
  out->st_uid = getuid();
  out->st_gid = getgid();
  out->st_nlink = what.file == nullptr ? 2 : 1;
  out->st_mode = what.file == nullptr ? S_IFDIR | 0755 : S_IFREG | static_cast<mode_t>(what.file->mode);
  if (what.file != nullptr) {
    out->st_size = static_cast<off_t>(what.file->registers ? what.file->bytes : what.file->content.size());
  }
  return 0;
}

int on_readdir(const char* path, void* buffer, fuse_fill_dir_t fill, off_t /*offset*/, fuse_file_info* /*info*/,
               fuse_readdir_flags /*flags*/) {
  const FuseTree::State& s = state();
  const auto add = [&](const std::string& name) { fill(buffer, name.c_str(), nullptr, 0, fuse_fill_dir_flags{}); };
  if (!named(path).exists) return -ENOENT;
  add(".");
  add("..");
  if (std::string_view(path) != "/") {
    for (const ServedFile& file : s.files) add(file.name);
    return 0;
  }
  for (std::size_t i = 0; i < s.folders.size(); ++i) {
    if (is_there(i)) add(s.folders[i]);
  }
  return 0;
}

int on_open(const char* path, fuse_file_info* info) {
  const Named what = named(path);
  if (what.file == nullptr) return -ENOENT;
  info->direct_io = 1;
  return what.file->registers ? state().handler->open(what.file->name) : 0;
}

int on_read(const char* path, char* data, size_t size, off_t offset, fuse_file_info* /*info*/) {
  const Named what = named(path);
  if (what.file == nullptr) return -ENODEV;  // the card was unplugged while the file was open
  const auto at = static_cast<std::size_t>(offset);
  if (what.file->registers) return what.behind ? state().handler->read(what.file->name, at, data, size) : -EIO;
  const std::string& content = what.file->content;
  return static_cast<int>(content.copy(data, size, std::min(at, content.size())));
}

int on_write(const char* path, const char* data, size_t size, off_t offset, fuse_file_info* /*info*/) {
  const Named what = named(path);
  if (what.file == nullptr) return -ENODEV;
  if (!what.file->registers || !what.behind) return -EACCES;
  return state().handler->write(what.file->name, static_cast<std::size_t>(offset), data, size);
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
  static const fuse_operations ops = operations();
  state_->tree = fuse_new(&arguments, &ops, sizeof ops, state_.get());
  fuse_opt_free_args(&arguments);
  if (state_->tree == nullptr || fuse_mount(state_->tree, root.c_str()) != 0) {
    if (state_->tree != nullptr) fuse_destroy(state_->tree);
    throw std::runtime_error(
        "cannot mount a FUSE tree at " + root +
        ": it needs /dev/fuse (sudo modprobe fuse), the package fuse3, and an empty folder that you own");
  }
}

FuseTree::~FuseTree() {
  fuse_unmount(state_->tree);
  fuse_destroy(state_->tree);
  free(state_->buffer.mem);
}

int FuseTree::descriptor() const { return fuse_session_fd(fuse_get_session(state_->tree)); }

bool FuseTree::serve() {
  fuse_session* session = fuse_get_session(state_->tree);
  const int got = fuse_session_receive_buf(session, &state_->buffer);
  if (got == -EINTR || got == -EAGAIN) return true;
  if (got <= 0) return false;
  fuse_session_process_buf(session, &state_->buffer);
  return fuse_session_exited(session) == 0;
}

}  // namespace abs_hil::program
