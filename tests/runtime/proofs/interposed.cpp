// Counts allocations and locks of a thread by functions put before the C library's.
#include "interposed.hpp"

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>

#include <cerrno>
#include <cstddef>

namespace abs_hil::runtime::test {

namespace {

thread_local bool counting = false;
thread_local Offences offences{};

void note_allocation() {
  if (counting) ++offences.allocations;
}
void note_lock() {
  if (counting) ++offences.locks;
}

/// The C library's own function of that name.
template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

OffenceCounter::OffenceCounter() {
  offences = {};
  counting = true;
}
OffenceCounter::~OffenceCounter() { counting = false; }
Offences OffenceCounter::so_far() const { return offences; }

}  // namespace abs_hil::runtime::test

using abs_hil::runtime::test::next;
using abs_hil::runtime::test::note_allocation;
using abs_hil::runtime::test::note_lock;

extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) {
  note_allocation();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  note_allocation();
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) {
  note_allocation();
  return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note_allocation();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  note_allocation();
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? ENOMEM : 0;
}
void free(void* block) {
  if (block != nullptr) note_allocation();
  __libc_free(block);
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  note_lock();
  static auto* const real = next<int(pthread_mutex_t*)>("pthread_mutex_lock");
  return real(mutex);
}
int pthread_mutex_trylock(pthread_mutex_t* mutex) {
  note_lock();
  static auto* const real = next<int(pthread_mutex_t*)>("pthread_mutex_trylock");
  return real(mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) {
  note_lock();
  static auto* const real = next<int(pthread_rwlock_t*)>("pthread_rwlock_rdlock");
  return real(lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) {
  note_lock();
  static auto* const real = next<int(pthread_rwlock_t*)>("pthread_rwlock_wrlock");
  return real(lock);
}
int pthread_spin_lock(pthread_spinlock_t* lock) {
  note_lock();
  static auto* const real = next<int(pthread_spinlock_t*)>("pthread_spin_lock");
  return real(lock);
}
int sem_wait(sem_t* semaphore) {
  note_lock();
  static auto* const real = next<int(sem_t*)>("sem_wait");
  return real(semaphore);
}

}  // extern "C"
