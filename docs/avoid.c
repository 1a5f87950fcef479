/* Drives to the waypoint, and turns away from what is near. */
#define _XOPEN_SOURCE 700
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NO_DECISION, AVOIDING, NAVIGATING, MOST_SENSORS = 64 };

/* The next number of a line; a null is NAN. The other characters only nest the numbers. */
static double number(char **at) {
    *at += strspn(*at, "[], ");
    if (strncmp(*at, "null", 4) == 0) {
        *at += 4;
        return NAN;
    }
    return strtod(*at, at);
}

/* What follows the next key of the first line, or NULL. A text cannot contain "key": itself, because
   its quotes would have backslashes. */
static char *value(char *from, const char *key) {
    char *found = strstr(from, key);
    return found ? found + strlen(key) : NULL;
}

int main(void) {
    FILE *lines = fdopen(atoi(getenv("EVOROS_IN")), "r");
    FILE *answers = fdopen(atoi(getenv("EVOROS_OUT")), "w");
    char *line = NULL;
    size_t space = 0;
    double yaws[MOST_SENSORS], state[6], leg[4];
    int sensors = 0;

    if (getline(&line, &space, lines) < 0)
        return 1;
    char *at = line, *drive = value(line, "\"drive\":");
    while ((at = value(at, "\"pose\":")) && at < drive) {
        for (int i = 0; i < 3; i++)
            number(&at);
        yaws[sensors++] = number(&at);
        if (sensors == MOST_SENSORS)
            break;
    }
    at = value(drive, "\"steering_limit_rad\":");
    double full_lock = number(&at);
    at = value(drive, "\"max_speed_mps\":");
    double top_speed = number(&at);
    at = value(drive, "\"near_m\":");
    if (at == NULL) {
        fprintf(answers, "{\"refused\": \"it needs controller.parameters.near_m\"}\n");
        fflush(answers);
        return 1;
    }
    double near = number(&at);
    fprintf(answers, "{\"ready\": true}\n");
    fflush(answers);

    while (getline(&line, &space, lines) > 0) {
        at = line;
        number(&at); /* the time */
        for (int i = 0; i < 6; i++)
            state[i] = number(&at);
        for (int i = 0; i < 4; i++)
            leg[i] = number(&at);
        double turn = 0.0; /* for each sensor that sees something near, away from its side */
        for (int i = 0; i < sensors; i++)
            if (number(&at) < near) /* false for a silent one, NAN */
                turn += yaws[i] > 0.0 ? -1.0 : 1.0;
        int mode = NO_DECISION;
        double steering = 0.0;
        if (turn != 0.0) {
            mode = AVOIDING;
            steering = copysign(full_lock, turn);
        } else if (!isnan(state[0] + state[1] + state[2])) { /* the localization is not silent */
            double bearing = atan2(leg[3] - state[1], leg[2] - state[0]);
            double error = remainder(bearing - state[2], 2.0 * M_PI);
            mode = NAVIGATING;
            steering = fmin(fmax(error, -full_lock), full_lock);
        }
        fprintf(answers, "[%d, %.17g, %.17g]\n", mode, top_speed, steering);
        fflush(answers);
    }
    return 0;
}
