/* Answers a mission as a recorded autopilot did, at once or after WORK_US of work.

   The tape, which the variable TAPE names, has for each frame the lengths of two parts, and the
   parts: the bytes of MAVLink before the frame, and the packet of servo outputs. */
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static unsigned char memory[1 << 20];

static struct sockaddr_in local(int port) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

static double now_us(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e6 * time.tv_sec + 1e-3 * time.tv_nsec;
}

static void work(double us) {
    static unsigned at;
    for (double end = now_us() + us; us > 0.0 && now_us() < end;)
        for (int i = 0; i < 64; i++) memory[at = (at + 4160) % sizeof memory]++;
}

int main(int count, char **words) {
    int servo_port = 0, mavlink_port = 0, on = 1;
    for (int i = 1; i + 1 < count; i++) {
        if (!strcmp(words[i], "--sim-port-out")) servo_port = atoi(words[i + 1]);
        if (!strcmp(words[i], "--serial0")) mavlink_port = atoi(strrchr(words[i + 1], ':') + 1);
    }
    double work_us = getenv("WORK_US") ? atof(getenv("WORK_US")) : 0.0;
    FILE *tape = fopen(getenv("TAPE"), "rb");
    struct sockaddr_in mavlink_at = local(mavlink_port), servos_at = local(servo_port);
    int mavlink = socket(AF_INET, SOCK_STREAM, 0), servos = socket(AF_INET, SOCK_DGRAM, 0);
    if (!tape || connect(mavlink, (void *)&mavlink_at, sizeof mavlink_at) ||
        connect(servos, (void *)&servos_at, sizeof servos_at))
        return 1;
    setsockopt(mavlink, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    static char said[1 << 16], packet[1 << 12], heard[1 << 16];
    unsigned lengths[2];
    while (fread(lengths, sizeof lengths, 1, tape) == 1) {
        if (lengths[0] > sizeof said || lengths[1] > sizeof packet ||
            fread(said, 1, lengths[0], tape) != lengths[0] ||
            fread(packet, 1, lengths[1], tape) != lengths[1])
            return 1;
        work(work_us);
        if (lengths[0] && send(mavlink, said, lengths[0], 0) < 0) return 1;
        send(servos, packet, lengths[1], 0);
        recv(servos, heard, sizeof heard, 0);
        while (recv(mavlink, heard, sizeof heard, MSG_DONTWAIT) > 0) continue;
    }
    pause();
}
