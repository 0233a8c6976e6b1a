// As much of an Arduino as the sketch needs, for the host: the test sets the time, and reads what the servos got.
#pragma once
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

unsigned long millis();

struct SerialPort {
  std::string in, out;
  void begin(unsigned long) {}
  int available() { return (int)in.size(); }
  int read() {
    const unsigned char first = (unsigned char)in[0];
    in.erase(0, 1);
    return first;
  }
  void println(const char *text) { out += std::string(text) + "\r\n"; }
};

extern SerialPort Serial;
