// A pan/tilt head of two hobby servos for MissionTree, without any ROS library: docs/head.md says how it is used.
// It hears and says lines, each with a CRC-16: "?" asks, "g BOOT PAN TILT" sends, "r BOOT PAN TILT" answers.
#include <EEPROM.h>
#include <Servo.h>

const int PINS[2] = {9, 10};         // where the servos are: pan, tilt
const unsigned long WATCHDOG = 300;  // ms without a line after which they stay where they are
const unsigned long STEP = 4;        // ms a degree: 250 degrees per second at most, whatever is sent

Servo servos[2];
int at[2] = {-1, -1}, goal[2];       // degrees; -1: it has got no pulse yet, and nobody knows where it stands
uint16_t boot;                       // another number after each start
unsigned long heard, stepped;
char line[48];
size_t size;

uint16_t crc16(const char *text, size_t count) {
  uint16_t crc = 0xFFFF;
  while (count--) {
    crc ^= (uint16_t)((uint8_t)*text++ << 8);
    for (int bit = 0; bit < 8; bit++) crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
  }
  return crc;
}

void send(int number, int degree) {
  servos[number].write(at[number] = degree);
  if (!servos[number].attached()) servos[number].attach(PINS[number]);
}

void aim(int number, int degree) {
  if (degree < 0 || degree > 180) return;
  goal[number] = degree;
  if (at[number] < 0) send(number, degree);
}

void say() {
  char said[40];
  int count = snprintf(said, sizeof said, "r %u %d %d", (unsigned)boot, at[0], at[1]);
  snprintf(said + count, sizeof said - count, "*%04X", (unsigned)crc16(said, count));
  Serial.println(said);
}

void obey() {
  char *star = strrchr(line, '*');
  if (!star || strlen(star) != 5 || strtoul(star + 1, 0, 16) != crc16(line, star - line)) return;
  *star = 0;
  heard = millis();
  unsigned asked;
  int pan, tilt;
  if (!strcmp(line, "?")) say();
  if (sscanf(line, "g %u %d %d", &asked, &pan, &tilt) == 3 && asked == boot) aim(0, pan), aim(1, tilt);
}

void setup() {
  Serial.begin(57600);
  EEPROM.get(0, boot);
  boot = boot % 32000 + 1;
  EEPROM.put(0, boot);
}

void loop() {
  while (Serial.available()) {
    char c = Serial.read();
    if (c != '\n') { line[size] = c; size += size < sizeof line - 1; continue; }
    line[size] = 0;
    size = 0;
    obey();
  }
  bool step = millis() - stepped >= STEP, silent = millis() - heard > WATCHDOG;
  if (step) stepped = millis();
  for (int number = 0; number < 2; number++) {
    if (at[number] < 0) continue;
    if (silent) goal[number] = at[number];
    if (step && at[number] != goal[number]) send(number, at[number] + (goal[number] > at[number] ? 1 : -1));
  }
}
