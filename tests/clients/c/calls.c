/*
 * Every call there is, once a round: calls PORT ROUNDS. Prints what each gave and the error it left, and stops at once
 * where a call that failed changed State[] otherwise.
 */
#include "Nclient.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static long before[NUM_STATE];

static void say(const char *name, long answer)
{
    printf("%s %ld %ld\n", name, answer, State[STATE_ERROR]);
    before[STATE_ERROR] = State[STATE_ERROR];
    if (answer == 0 && memcmp(before, State, sizeof State) != 0) {
        printf("%s failed and changed State[]\n", name);
        exit(1);
    }
    memcpy(before, State, sizeof State);
}

static void tell(const char *name, const long *numbers, long count)
{
    long i;

    printf("%s", name);
    for (i = 0; i < count; i++)
        printf(" %ld", numbers[i]);
    printf("\n");
}

static void drive(void)
{
    say("ac", ac(1, -2, 3));
    say("sp", sp(4, 5, -6));
    say("vm", vm(-7, 8, 9));
    say("pr", pr(-10, 11, 12));
    say("pa", pa(1, 2, 3));
    say("mv", mv(MV_VM, -13, MV_PR, 14, MV_IGNORE, 15));
    say("mv", mv(6, 0, 0, 0, 0, 0));
    say("st", st());
    say("lp", lp());
    say("zr", zr());
    say("ws", ws(1, 0, 1, 300));
    say("dp", dp(-16, 17));
    say("da", da(18, -19));
    say("place_robot", place_robot(20, -21, 22, 23));
    say("conf_tm", conf_tm(255));
    say("tk", tk(""));
    say("tk", tk("four"));
    say("tk", tk("hello, world"));
    say("gs", gs());
}

static void sense(void)
{
    static int off[1] = {255}, early[3] = {3, 2, -1}, all[16] = {0, 2, 15, 1, 14, 3, 13, 4, 12, 5, 11, 6, 10, 7, 9, 8};
    PosData ring[16];

    say("conf_ir", conf_ir(5, early));
    say("conf_sn", conf_sn(15, all));
    say("conf_sn", conf_sn(0, off));
    say("conf_cp", conf_cp(2));
    say("conf_ls", conf_ls(51, 1, 2, 3, 4));
    say("conf_sg", conf_sg(5, 6, 7));
    set_mask(Smask);
    Smask[SMASK_IR_1] = 0;
    Smask[SMASK_SONAR_16] = 0;
    Smask[SMASK_BUMPER] = -1;
    Smask[SMASK_COMPASS] = 0;
    say("ct", ct());
    say("posDataRequest", posDataRequest(32));
    say("posDataRequest", posDataRequest(POS_SONAR | POS_BUMPER | POS_COMPASS));
    say("posDataCheck", posDataCheck());
    say("get_ir", get_ir());
    say("get_sn", get_sn());
    say("get_bp", get_bp());
    say("get_cp", get_cp());
    say("get_rc", get_rc());
    say("get_rv", get_rv());
    say("get_ra", get_ra());
    say("get_ls", get_ls());
    say("get_sg", get_sg());
    posSonarRingGet(ring);
    printf("place %ld %ld %lu\n", ring[15].config.configX, ring[15].config.velTurret, ring[15].timeStamp);
    say("posSonarGet", posSonarGet(&ring[0], 16));
    say("init_sensors", init_sensors());
}

static void simulate(void)
{
    static int laser[2 * NUM_LASER + 1];
    static unsigned char packet[8] = {8, 0, 1, 99, 200, 100, 50, 25}, reply[USER_BUFFER_LENGTH];
    static long robots[1 + 3 * NUM_RPX];
    long square[21], state[NUM_STATE], conf[4] = {0, 0, 0, 0}, left = 0, crowd[1] = {11};
    double hit[3] = {0.0, 0.0, 0.0};
    int i;

    for (i = 0; i < 21; i++)
        square[i] = i == 0 ? 4 : -i;
    memset(state, 0, sizeof state);
    say("add_obstacle", add_obstacle(square));
    say("add_Obs", add_Obs(crowd));
    say("move_obstacle", move_obstacle(square, 5, -6));
    tell("moved to", square, 9);
    say("delete_Obs", delete_Obs(square));
    say("new_world", new_world());
    say("get_robot_conf", get_robot_conf(conf));
    tell("conf", conf, 4);
    if (get_rpx(robots))
        tell("robots", robots, 1 + 3 * robots[0]);
    say("predict_sensors", predict_sensors(-1, 2, 3, 4, state, laser));
    printf("predicted %ld %ld %ld %d %d\n", state[1], state[32], state[33], laser[0], laser[1]);
    say("motion_check", motion_check(0L, 1.29, -2.0, 3.25, 4.0, 9.0, 9.0, 9.0, hit));
    printf("hit %.2f %.2f %.6f\n", hit[0], hit[1], hit[2]);
    say("motion_check", motion_check(1L, 1.0, -2.0, -0.5, 3.1415926, 50.0, 7.0, 8.0, hit));
    say("draw_robot", draw_robot(-1L, 2L, 3, 4, 5));
    say("draw_line", draw_line(-1L, 2L, -3L, 4L, 6));
    say("draw_arc", draw_arc(-1L, 2L, 3L, 4L, 5, 6, 7));
    say("special_request", special_request(packet, reply));
    printf("packet %d %d\n", reply[3], reply[4]);
    say("arm_zero", arm_zero(-2));
    say("arm_ws", arm_ws(1, 0, -70000L, &left));
    printf("left %ld\n", left);
    say("arm_mv", arm_mv(1L, -300L, 2L, 400L));
}

static void manage(void)
{
    say("refresh_all", refresh_all());
    say("refresh_all_traces", refresh_all_traces());
    say("refresh_actual_trace", refresh_actual_trace());
    say("refresh_encoder_trace", refresh_encoder_trace());
    say("refresh_all_sensors", refresh_all_sensors());
    say("refresh_bumper_sensor", refresh_bumper_sensor());
    say("refresh_infrared_sensor", refresh_infrared_sensor());
    say("refresh_sonar_sensor", refresh_sonar_sensor());
    say("refresh_laser_sensor", refresh_laser_sensor());
    say("refresh_client_graphics", refresh_client_graphics());
    say("real_robot", real_robot());
    say("simulated_robot", simulated_robot());
    say("quit_server", quit_server());
}

int main(int argc, char **argv)
{
    int round;

    if (argc != 3)
        return 2;
    set_serv_tcp_port(atoi(argv[1]));
    set_server_machine_name("127.0.0.1");
    for (round = atoi(argv[2]); round > 0; round--) {
        say("connect_robot", connect_robot(1L));
        drive();
        say("create_robot", create_robot(2L));
        sense();
        say("connect_robot", connect_robot(0L));
        simulate();
        say("server_is_running", server_is_running());
        manage();
        say("disconnect_robot", disconnect_robot(1L));
    }
    return 0;
}
