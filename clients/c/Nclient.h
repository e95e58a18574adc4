/*
 * Nclient.h: driving a robot behind an Nserver from C.
 *
 * A program says which robot it drives with connect_robot(), asks for things with the calls below, and finds what the
 * robot last said in State[]. Each call waits for the server's answer and gives 1, or 0 if that was not to be had:
 * State[STATE_ERROR] then says why, and all other entries keep their values.
 *
 * Units: lengths 1/10 inch, angles 1/10 degree counter-clockwise, speeds and accelerations these per second (and per
 * second squared). A Scout's axes are its right wheel, its left wheel and nothing, where a Nomad 200's are way,
 * steering and turret.
 */
#ifndef NCLIENT_H
#define NCLIENT_H

#ifdef __cplusplus
extern "C" {
#endif

#define NUM_STATE 45
#define NUM_MASK 44
#define NUM_LASER 482 /* points; Laser[] holds how many there are, then x and y of each */
#define INFRAREDS 16
#define SONARS 16
#define MAX_VERTICES 10 /* of an obstacle */
#define NUM_RPX 1000    /* robots that get_rpx() tells of; its array holds 1 + 3 * NUM_RPX numbers */
#define USER_BUFFER_LENGTH 65535

/* What a program may call its robot in connect_robot(); every model is driven in the same way. */
#define MODEL_N200 0
#define MODEL_N150 1
#define MODEL_SCOUT 2
#define MODEL_SCOUT2 3

/* ---- State[]: what the robot last said */

#define STATE_SIM_SPEED 0 /* 10: real time */
#define STATE_IR_0 1      /* infrared 0 to 15, counter-clockwise from the front: 0 to 15, 15 for nothing near */
#define STATE_IR_1 2
#define STATE_IR_2 3
#define STATE_IR_3 4
#define STATE_IR_4 5
#define STATE_IR_5 6
#define STATE_IR_6 7
#define STATE_IR_7 8
#define STATE_IR_8 9
#define STATE_IR_9 10
#define STATE_IR_10 11
#define STATE_IR_11 12
#define STATE_IR_12 13
#define STATE_IR_13 14
#define STATE_IR_14 15
#define STATE_IR_15 16
#define STATE_SONAR_0 17 /* sonar 0 to 15, likewise: whole inches from its face, 6 to 255, 255 for nothing near */
#define STATE_SONAR_1 18
#define STATE_SONAR_2 19
#define STATE_SONAR_3 20
#define STATE_SONAR_4 21
#define STATE_SONAR_5 22
#define STATE_SONAR_6 23
#define STATE_SONAR_7 24
#define STATE_SONAR_8 25
#define STATE_SONAR_9 26
#define STATE_SONAR_10 27
#define STATE_SONAR_11 28
#define STATE_SONAR_12 29
#define STATE_SONAR_13 30
#define STATE_SONAR_14 31
#define STATE_SONAR_15 32
#define STATE_BUMPER 33 /* one bit for each switch that is pressed */
#define STATE_CONF_X 34 /* where the encoders say that the robot is */
#define STATE_CONF_Y 35
#define STATE_CONF_STEER 36  /* 0 to 3599; of a Scout its heading */
#define STATE_CONF_TURRET 37 /* 0 to 3599 */
#define STATE_VEL_TRANS 38   /* of a Scout its right wheel */
#define STATE_VEL_STEER 39   /* of a Scout its left wheel */
#define STATE_VEL_TURRET 40
#define STATE_MOTOR_STATUS 41 /* bits 0, 1, 2: that axis is turning */
#define STATE_LASER 42        /* mode */
#define STATE_COMPASS 43
#define STATE_ERROR 44 /* 0, what the server said was wrong, or one of the three below */

#define NCLIENT_BAD_REPLY 4       /* what the server answered makes no sense */
#define NCLIENT_BAD_ARGUMENT 22   /* nothing was sent: the server could not have understood it */
#define NCLIENT_NO_CONNECTION 111 /* there is none or it was lost; connect_robot() makes a new one */

/* ---- Smask[]: which entries of State[] the robot keeps up to date, 0 for those that it need not; ct() sends it */

#define SMASK_POS_DATA 0 /* a sum of the POS_ values below */
#define SMASK_IR_1 1
#define SMASK_IR_2 2
#define SMASK_IR_3 3
#define SMASK_IR_4 4
#define SMASK_IR_5 5
#define SMASK_IR_6 6
#define SMASK_IR_7 7
#define SMASK_IR_8 8
#define SMASK_IR_9 9
#define SMASK_IR_10 10
#define SMASK_IR_11 11
#define SMASK_IR_12 12
#define SMASK_IR_13 13
#define SMASK_IR_14 14
#define SMASK_IR_15 15
#define SMASK_IR_16 16
#define SMASK_SONAR_1 17
#define SMASK_SONAR_2 18
#define SMASK_SONAR_3 19
#define SMASK_SONAR_4 20
#define SMASK_SONAR_5 21
#define SMASK_SONAR_6 22
#define SMASK_SONAR_7 23
#define SMASK_SONAR_8 24
#define SMASK_SONAR_9 25
#define SMASK_SONAR_10 26
#define SMASK_SONAR_11 27
#define SMASK_SONAR_12 28
#define SMASK_SONAR_13 29
#define SMASK_SONAR_14 30
#define SMASK_SONAR_15 31
#define SMASK_SONAR_16 32
#define SMASK_BUMPER 33
#define SMASK_CONF_X 34
#define SMASK_CONF_Y 35
#define SMASK_CONF_STEER 36
#define SMASK_CONF_TURRET 37
#define SMASK_VEL_TRANS 38
#define SMASK_VEL_STEER 39
#define SMASK_VEL_TURRET 40
#define SMASK_RESERVED 41
#define SMASK_LASER 42
#define SMASK_COMPASS 43

/* ---- variables that programs set and read */

extern long State[NUM_STATE];
extern int Smask[NUM_MASK];
extern int Laser[2 * NUM_LASER + 1];
extern char SERVER_MACHINE_NAME[80]; /* "": this machine */
extern int SERV_TCP_PORT;            /* 7019 unless the program says otherwise */

/* Of programs that drive a robot over its own wire; they mean nothing behind a server. */
extern char ROBOT_MACHINE_NAME[80];
extern int CONN_TYPE;
extern char SERIAL_PORT[40];
extern int SERIAL_BAUD;
extern int ROBOT_TCP_PORT;
extern double LASER_CALIBRATION[8];
extern double LASER_OFFSET[2];

/* ---- a Scout's wheels for a forward speed (or way) and a turn: 1/10 inch and 1/10 degree */

#define ROTATION_CONSTANT 0.118597 /* inches that a wheel goes for one degree of turn */
#define RIGHT(trans, steer) ((trans) + (int) ((steer) * ROTATION_CONSTANT))
#define LEFT(trans, steer) ((trans) - (int) ((steer) * ROTATION_CONSTANT))
#define scout_vm(trans, steer) vm(RIGHT(trans, steer), LEFT(trans, steer), 0)
#define scout_pr(trans, steer) pr(RIGHT(trans, steer), LEFT(trans, steer), 0)

/* ---- to whom */

int connect_robot(long robot_id, ...); /* 0: refused; what else a program tells it (model, device, baud) is ignored */
int create_robot(long robot_id);
int disconnect_robot(long robot_id);
int server_is_running(void); /* connects robot 1 */
int set_server_machine_name(const char *name);
int set_serv_tcp_port(int port);
int quit_server(void);
int real_robot(void);
int simulated_robot(void);

/* ---- moving */

int ac(int first, int second, int third); /* accelerations */
int sp(int first, int second, int third); /* how fast pr() goes */
int vm(int first, int second, int third); /* speeds, from now on */
int pr(int first, int second, int third); /* so far from here */
int pa(int first, int second, int third); /* no server can: always 0 */
int st(void);                             /* stop and hold */
int lp(void);                             /* let go of the motors */

#define MV_IGNORE 0
#define MV_VM 1
#define MV_PR 2
#define MV_LP 3
#define MV_AC 4
#define MV_SP 5
int mv(int first_mode, int first, int second_mode, int second, int third_mode, int third);

int ws(int first, int second, int third, int timeout); /* wait until these axes stand, or for so many seconds */
int zr(void);                                          /* find home; everything is 0 then */
int dp(int x, int y);                                  /* it is here, whatever its encoders say */
int da(int steering, int turret);                      /* likewise */
int place_robot(int x, int y, int steering, int turret);
int conf_tm(int seconds); /* stop if no call comes for so long, 0 to 255; 0: never */
int tk(const char *text); /* say something */

/* ---- sensing */

int gs(void);
int ct(void); /* send Smask[] */
int get_ir(void);
int get_sn(void);
int get_rc(void);
int get_rv(void);
int get_ra(void); /* accelerations, into the three speeds of State[] */
int get_cp(void);
int get_ls(void);
int get_sg(void);
int get_bp(void);

/* An order names sensors 0 to 15 and ends at the first number that is none, or after 16. */
int conf_ir(int history, int *order);
int conf_sn(int rate, int *order); /* a pause of rate times 4 ms after each echo */
int conf_cp(int mode);
int conf_ls(int mode, int threshold, int width, int points, int processing);
int conf_sg(int threshold, int least_points, int gap);

void init_mask(void);   /* Smask[]: all on, no positions */
int init_sensors(void); /* the same, and send it */
int get_state(long state[NUM_STATE]);
int get_laser(int laser[2 * NUM_LASER + 1]); /* as many of them as there are */
int get_mask(int mask[NUM_MASK]);
int set_mask(int mask[NUM_MASK]);

/* ---- where the robot was when a sensor took its reading */

#define POS_NONE 0
#define POS_INFRARED 1
#define POS_SONAR 2
#define POS_BUMPER 4
#define POS_LASER 8
#define POS_COMPASS 16

typedef struct {
    long configX, configY, configSteer, configTurret;
    long velTrans, velSteer, velTurret;
    unsigned long timeStamp; /* of these seven, ms of the sensor board's clock */
} PosConfig;

typedef struct {
    PosConfig config;
    unsigned long timeStamp; /* of the reading */
} PosData;

int posDataRequest(int which); /* a sum of POS_ values */
int posDataCheck(void);        /* that sum, as the server knows it */
int posInfraredRingGet(PosData places[INFRAREDS]);
int posInfraredGet(PosData *place, int number);
int posSonarRingGet(PosData places[SONARS]);
int posSonarGet(PosData *place, int number);
int posBumperGet(PosData *place);
int posLaserGet(PosData *place);
int posCompassGet(PosData *place);
long posTimeGet(void); /* the sensor board's clock, ms */
float voltCpuGet(void);
float voltMotorGet(void);

/* ---- the simulated world: n, x1, y1 ... xn, yn, counter-clockwise */

int add_obstacle(long *obstacle);
int add_Obs(long *obstacle);
int delete_obstacle(long *obstacle);
int delete_Obs(long *obstacle);
int move_obstacle(long *obstacle, long dx, long dy); /* leaves there where it is now */
int move_Obs(long *obstacle, long dx, long dy);
int new_world(void);

int get_robot_conf(long conf[4]); /* x, y, steering, turret of where somebody clicks in the robot's window */
int get_rpx(long *robots);        /* n, then three numbers for each robot */
int predict_sensors(int x, int y, int steering, int turret, long state[NUM_STATE], int laser[2 * NUM_LASER + 1]);

/*
 * Would it touch something on the way? Type 0: from x, y (a1, a2) to x, y (a3, a4). Type 1: from x, y (a1, a2), which
 * lies on the circle of radius a5 round x, y (a6, a7), from angle a3 to angle a4 (rad). 1: yes, at x, y in collide[0]
 * and [1], and the direction in collide[2] (rad) leads away from what it touches. Without an answer it is 1 as well.
 */
int motion_check(long type, double a1, double a2, double a3, double a4, double a5, double a6, double a7,
                 double collide[3]);

/* ---- drawing in the server's windows. Mode 1 to 3: black, with or without XOR; above: a colour */

int draw_robot(long x, long y, int steering, int turret, int mode);
int draw_line(long x1, long y1, long x2, long y2, int mode);
int draw_arc(long x, long y, long width, long height, int begin, int end, int mode);
int refresh_all(void);
int refresh_all_traces(void);
int refresh_actual_trace(void);
int refresh_encoder_trace(void);
int refresh_all_sensors(void);
int refresh_bumper_sensor(void);
int refresh_infrared_sensor(void);
int refresh_sonar_sensor(void);
int refresh_laser_sensor(void);
int refresh_client_graphics(void);

/* ---- packets of bytes for what a user has built onto the robot */

/* length (two bytes, the low one first, counting everything), serial number, type, data */
int special_request(unsigned char *request, unsigned char *reply);

/*
 * Writing the data: init_send_buffer() sets the index to where they begin, each stuff call writes its number there and
 * moves the index on, and stuff_send_buffer_header() writes what stands before them, with the index as the length. All
 * of these give the index; 0 says that the number has no room in USER_BUFFER_LENGTH bytes.
 */
int init_send_buffer(unsigned short *index);
int stuffchar(signed char data, unsigned char *buffer, unsigned short *index);
int stuff2byteint(signed short data, unsigned char *buffer, unsigned short *index);
int stuff4byteint(signed long data, unsigned char *buffer, unsigned short *index);
int stuffuchar(unsigned char data, unsigned char *buffer, unsigned short *index);
int stuff2byteuint(unsigned short data, unsigned char *buffer, unsigned short *index);
int stuff4byteuint(unsigned long data, unsigned char *buffer, unsigned short *index);
int stuffdouble(double data, unsigned char *buffer, unsigned short *index);
int stuff_send_buffer_header(unsigned short length, unsigned char serial, unsigned char type, unsigned char *buffer);

/* Reading a reply, likewise. */
int extract_receive_buffer_header(unsigned short *length, unsigned char *serial, unsigned char *type,
                                  unsigned char *buffer);
int init_receive_buffer(unsigned short *index);
signed char extractchar(unsigned char *buffer, unsigned short *index);
signed short extract2byteint(unsigned char *buffer, unsigned short *index);
signed long extract4byteint(unsigned char *buffer, unsigned short *index);
unsigned char extractuchar(unsigned char *buffer, unsigned short *index);
unsigned short extract2byteuint(unsigned char *buffer, unsigned short *index);
unsigned long extract4byteuint(unsigned char *buffer, unsigned short *index);
double extractdouble(unsigned char *buffer, unsigned short *index);

/* Packets of the arm. */
int arm_zero(int override);
int arm_zr(int override); /* the same */
int arm_ws(int lift, int gripper, long timeout, long *time_left);
int arm_mv(long lift_mode, long lift, long gripper_mode, long gripper);

#ifdef __cplusplus
}
#endif

#endif
