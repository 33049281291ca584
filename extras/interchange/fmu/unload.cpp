// What a compiler's start files do when a shared library is unloaded. zig brings none for Linux: a tool that unloads an
// FMU would run the destructors of its static objects at the tool's own end, in memory that is gone.

// NOLINTBEGIN(bugprone-reserved-identifier): the names of the Itanium C++ ABI
extern "C" {
extern void* __dso_handle __attribute__((visibility("hidden")));  // this library, to the C library
void __cxa_finalize(void* library);
}
// NOLINTEND(bugprone-reserved-identifier)

namespace {

[[gnu::destructor]] void destroy_statics() { __cxa_finalize(&__dso_handle); }

}  // namespace
