// The Servo library as far as the sketch uses it: pulses go out once it is attached.
#pragma once

struct Servo {
  int degree = 90, pin = -1;
  void write(int value) { degree = value; }
  bool attached() const { return pin >= 0; }
  void attach(int number) { pin = number; }
};
