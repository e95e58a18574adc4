/* The calls of the session that was once written down on the wire, and what is then known of the robot. */
#include "Nclient.h"

#include <stdio.h>
#include <stdlib.h>

static void say(int answer)
{
    printf("%d ", answer);
}

int main(int argc, char **argv)
{
    int order[16], i;

    if (argc != 2)
        return 2;
    SERV_TCP_PORT = atoi(argv[1]);
    set_server_machine_name("127.0.0.1");
    for (i = 0; i < 16; i++)
        order[i] = i;
    say(connect_robot(9L));
    say(connect_robot(1L, MODEL_SCOUT2, "/dev/ttyS0", 38400));
    say(conf_tm(1));
    say(conf_sn(1, order));
    say(zr());
    say(ws(1, 1, 1, 20));
    say(place_robot(-100, -200, 900, 450));
    say(scout_vm(15, 320));
    say(gs());
    say(tk("Ouch."));
    for (i = 0; i < NUM_STATE; i++)
        printf("%ld ", State[i]);
    printf("%d %ld %.3f %.3f ", Laser[0], posTimeGet(), voltCpuGet(), voltMotorGet());
    say(disconnect_robot(1L));
    return 0;
}
