/* The four calls whose answers hold a laser's points: answer, error, how many points, and the last number that fits. */
#include "Nclient.h"

#include <stdio.h>
#include <stdlib.h>

static int predicted[2 * NUM_LASER + 1];

static void say(int answer, const int *laser)
{
    printf("%d %ld %d %d\n", answer, State[STATE_ERROR], laser[0], laser[2 * NUM_LASER]);
}

int main(int argc, char **argv)
{
    long state[NUM_STATE];
    int copy[2 * NUM_LASER + 1] = {0};

    if (argc != 2)
        return 2;
    SERV_TCP_PORT = atoi(argv[1]);
    set_server_machine_name("127.0.0.1");
    connect_robot(1L);
    say(gs(), Laser);
    get_laser(copy);
    Laser[0] = Laser[2 * NUM_LASER] = 0;
    say(get_ls(), Laser);
    Laser[0] = Laser[2 * NUM_LASER] = 0;
    say(get_sg(), Laser);
    say(predict_sensors(0, 0, 0, 0, state, predicted), predicted);
    say(0, copy);
    return 0;
}
