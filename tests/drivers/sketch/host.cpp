// Runs the sketch on the host. A line in: the time in milliseconds and what the computer has sent, in hexadecimal.
// A line out: what the sketch has said, in hexadecimal; where its servos were sent, -1 for no pulse; its EEPROM.
#include "Arduino.h"
#include "EEPROM.h"
#include "Servo.h"

#include SKETCH

static unsigned long now_ms;
unsigned long millis() { return now_ms; }
SerialPort Serial;
Memory EEPROM;

int main(int count, char **words) {
  std::memset(EEPROM.bytes, 0xFF, sizeof EEPROM.bytes);
  if (count > 1) {
    const uint16_t kept = (uint16_t)std::strtoul(words[1], nullptr, 10);
    EEPROM.put(0, kept);
  }
  setup();
  char text[70000];
  while (std::fgets(text, sizeof text, stdin)) {
    char *end;
    now_ms = std::strtoul(text, &end, 10);
    for (const char *digit = end + 1; digit[0] > ' ' && digit[1] > ' '; digit += 2) {
      const char pair[3] = {digit[0], digit[1], 0};
      Serial.in += (char)std::strtoul(pair, nullptr, 16);
    }
    loop();
    uint16_t kept;
    EEPROM.get(0, kept);
    std::printf("-");
    for (const char c : Serial.out) std::printf("%02x", (unsigned char)c);
    for (const Servo &each : servos) std::printf(" %d", each.attached() ? each.degree : -1);
    std::printf(" %u\n", (unsigned)kept);
    Serial.out.clear();
    std::fflush(stdout);
  }
}
