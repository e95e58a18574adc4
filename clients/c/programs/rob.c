/*
 * rob.c: a Scout wanders; after a datagram it stops as soon as something in front is less than ten inches away, and
 * stays.
 *
 * Built twice: ROBOT is its number, DATAGRAMS the port at which it hears.
 */
#define _XOPEN_SOURCE 600

#include "../Nclient.h"
#include "datagrams.h"
#include "scout.h"

#include <poll.h>
#include <stdio.h>

#define STAND_OFF 10 /* inches */

/* Say so once it stands; whether it does. */
static int stands(const struct scout *scout)
{
    static int said = 0;

    if (!said && State[STATE_VEL_TRANS] == 0 && State[STATE_VEL_STEER] == 0) {
        printf("robot %d stopped with %ld in ahead\n", scout->robot, nearest_front());
        fflush(stdout);
        said = 1;
    }
    return said;
}

int main(int argc, char **argv)
{
    struct scout scout = {"", 7019, ROBOT, 1, 20, 0, DATAGRAMS, THIS_MACHINE, 0};
    double numbers[NUMBERS];
    struct pollfd ready;
    int told = 0, stopped = 0;

    read_options(argc, argv, "h:p:r:f:w:n:d:l:q", &scout);
    ready.fd = listen_at(scout.listen, scout.datagrams);
    ready.events = POLLIN;
    if (ready.fd == -1 || !begin_scout(&scout))
        return 1;
    printf("robot %d wanders and listens at port %d\n", scout.robot, scout.datagrams);
    fflush(stdout);
    while (goes_on(&scout)) {
        while (hear(ready.fd, numbers)) {
            printf("robot %d was told %.2f %.2f %.2f\n", scout.robot, numbers[0], numbers[1], numbers[2]);
            fflush(stdout);
            told = 1;
        }
        stopped = stopped || (told && nearest_front() < STAND_OFF);
        if (!(stopped ? st() : wander()) || (stopped && stands(&scout) && scout.leave))
            break;
        poll(&ready, 1, scout.pause);
    }
    return end_scout(&scout);
}
