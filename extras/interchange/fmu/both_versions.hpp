// Functions that FMI 2.0 and 3.0 have alike but for their names. The source of each version includes this once, in its
// extern "C", after it has defined ABS_HIL_FMI(name), the name with the version before it, and what the version calls a
// state, and to read one from bytes.

const char* ABS_HIL_FMI(GetVersion)() { return ABS_HIL_FMI(Version); }
void ABS_HIL_FMI(FreeInstance)(void* c) { delete of(c); }
Status ABS_HIL_FMI(SetDebugLogging)(void*, ABS_HIL_FMI(Boolean), size_t, const ABS_HIL_FMI(String)[]) {
  return ok<Status>;
}

Status ABS_HIL_FMI(ExitInitializationMode)(void* c) {
  return done<Status>(c, [&] { of(c)->start(); });
}
Status ABS_HIL_FMI(Terminate)(void* c) {
  return done<Status>(c, [] {});
}
Status ABS_HIL_FMI(Reset)(void* c) {
  return done<Status>(c, [&] { of(c)->reset(); });
}

Status ABS_HIL_FMI_OF_STATE(Get, )(void* c, void** state) {
  return done<Status>(c, [&] { keep(of(c)->state(), *state); });
}
Status ABS_HIL_FMI_OF_STATE(Set, )(void* c, void* state) {
  return done<Status>(c, [&] { of(c)->restore(*static_cast<State*>(state)); });
}
Status ABS_HIL_FMI_OF_STATE(Free, )(void* c, void** state) {
  return done<Status>(c, [&] { delete static_cast<State*>(std::exchange(*state, nullptr)); });
}
Status ABS_HIL_FMI_OF_STATE(Serialized, Size)(void* c, void* state, size_t* size) {
  return done<Status>(c, [&] { *size = to_bytes(*static_cast<State*>(state)).size(); });
}
Status ABS_HIL_FMI_OF_STATE(Serialize, )(void* c, void* state, ABS_HIL_FMI(Byte) bytes[], size_t size) {
  return done<Status>(c, [&] { write_bytes(*static_cast<State*>(state), bytes, size); });
}
Status ABS_HIL_FMI_READ_STATE(void* c, const ABS_HIL_FMI(Byte) bytes[], size_t size, void** state) {
  return done<Status>(c, [&] { keep(state_of(std::string(bytes, bytes + size)), *state); });
}
