// Memory that outlives a start: it begins as a new one does, with all bits set.
#pragma once
#include <cstdint>
#include <cstring>

struct Memory {
  uint8_t bytes[16];
  template <typename T> void get(int place, T &value) { std::memcpy(&value, bytes + place, sizeof value); }
  template <typename T> void put(int place, const T &value) { std::memcpy(bytes + place, &value, sizeof value); }
};

extern Memory EEPROM;
