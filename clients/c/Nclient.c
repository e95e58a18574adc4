/*
 * Nclient.c: the calls of Nclient.h, over one TCP connection to an Nserver.
 *
 * The plan: a call writes its request into `message` (begin, put), exchange() sends it and reads the whole answer to
 * the same place, and the call takes the answer apart (take) once it knows that it is all there. Nothing of an answer
 * is believed before that, and an answer that makes no sense changes nothing of what programs read.
 *
 * A message is a type and a number of words, two bytes each, then the words, four bytes each, all with the high byte
 * first. Bytes are put together and taken apart by shifting alone, so that neither the size of a long nor the order of
 * the machine's bytes matters.
 */
#define _XOPEN_SOURCE 600 /* getaddrinfo() among strictly standard names */
#define _DARWIN_C_SOURCE

#include "Nclient.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0 /* where it is not known, SO_NOSIGPIPE says the same of the whole socket */
#endif

#define MAX_WORDS 65535L     /* of one message: its length has two bytes */
#define MAX_PACKET 65530L    /* bytes of a user's packet, each in a word of its own */
#define PACKET_HEAD 4        /* bytes in front of a packet's data */
#define ARM_PACKET 256       /* bytes of the largest answer of an arm */
#define PLACE_WORDS 9        /* of a PosData */
#define END_OF_ORDER 255     /* no sensor's number */
#define NO_CONNECTION (-1)

enum { CREATE = 101, CONNECT = 102, DISCONNECT = 103, ERROR_REPLY = 91, NO_MESSAGE = 0xFFFF };

long State[NUM_STATE];
int Smask[NUM_MASK];
int Laser[2 * NUM_LASER + 1];
char SERVER_MACHINE_NAME[80] = "";
int SERV_TCP_PORT = 7019;

char ROBOT_MACHINE_NAME[80] = "";
int CONN_TYPE = -1;
char SERIAL_PORT[40] = "";
int SERIAL_BAUD = -1;
int ROBOT_TCP_PORT = -1;
double LASER_CALIBRATION[8] = {-0.003470, 0.000008, 0.011963, 0.001830, 27.5535913, 0.000428, 0.031102, -0.444624};
double LASER_OFFSET[2] = {0.0, 0.0};

static int connection = NO_CONNECTION;
static unsigned char message[4 + 4 * MAX_WORDS];
static long words; /* in it */
static long at;    /* the next of them to take */

static int attached;   /* POS_ values that the server knows: it sends those places */
static int laser_used; /* of Laser[], after its first */
static PosData infrared_places[INFRAREDS], sonar_places[SONARS], bumper_place, laser_place, compass_place;
static long board_clock;
static int cpu_battery, motor_battery; /* as they come, 0 to 255 */

/* ---- what can go wrong */

static int wrong(int error)
{
    State[STATE_ERROR] = error;
    return 0;
}

static int lost(const char *why)
{
    if (connection != NO_CONNECTION) {
        close(connection);
        connection = NO_CONNECTION;
        fprintf(stderr, "Nclient: the connection to the server is lost: %s; connect_robot() makes a new one.\n", why);
    }
    return wrong(NCLIENT_NO_CONNECTION);
}

/* ---- words */

static void put_pair(unsigned char *place, long number)
{
    place[0] = (unsigned char) (number >> 8 & 0xFF);
    place[1] = (unsigned char) (number & 0xFF);
}

static void begin(int type)
{
    put_pair(message, type);
    words = 0;
}

static void put(long number)
{
    unsigned long word = (unsigned long) number;
    unsigned char *place = message + 4 + 4 * words++;

    place[0] = (unsigned char) (word >> 24 & 0xFF);
    place[1] = (unsigned char) (word >> 16 & 0xFF);
    place[2] = (unsigned char) (word >> 8 & 0xFF);
    place[3] = (unsigned char) (word & 0xFF);
}

static unsigned long look(long index)
{
    const unsigned char *place = message + 4 + 4 * index;

    return (unsigned long) place[0] << 24 | (unsigned long) place[1] << 16 | (unsigned long) place[2] << 8 | place[3];
}

/* The number that 32 bits stand for. What a long holds above them is left out: where a program that did not include
   Nclient.h gives an int for a long, anything may be there. */
static long narrow(unsigned long word)
{
    word &= 0xFFFFFFFFUL;
    return word & 0x80000000UL ? -(long) (0xFFFFFFFFUL - word) - 1 : (long) word;
}

static long value(long index)
{
    return narrow(look(index));
}

static long take(void)
{
    return value(at++);
}

/* ---- the connection */

static int reach(int one, const struct sockaddr *address, socklen_t length)
{
    struct pollfd ready;
    int error = 0;
    socklen_t size = sizeof error;

    if (connect(one, address, length) == 0)
        return 1;
    if (errno != EINTR)
        return 0;
    ready.fd = one; /* a signal came: the system goes on connecting by itself */
    ready.events = POLLOUT;
    while (poll(&ready, 1, -1) < 0)
        if (errno != EINTR)
            return 0;
    if (getsockopt(one, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0)
        return 1;
    errno = error;
    return 0;
}

static int dial(const char *name, const char **why)
{
    struct addrinfo wanted, *found, *next;
    char port[16];
    int one = NO_CONNECTION, yes = 1, problem;

    memset(&wanted, 0, sizeof wanted);
    wanted.ai_socktype = SOCK_STREAM;
    sprintf(port, "%d", SERV_TCP_PORT);
    problem = getaddrinfo(name, port, &wanted, &found);
    if (problem != 0) {
        *why = gai_strerror(problem);
        return NO_CONNECTION;
    }
    for (next = found; next != NULL && one == NO_CONNECTION; next = next->ai_next) {
        one = socket(next->ai_family, next->ai_socktype, next->ai_protocol);
        if (one != NO_CONNECTION && reach(one, next->ai_addr, next->ai_addrlen))
            break;
        *why = strerror(errno);
        if (one != NO_CONNECTION)
            close(one);
        one = NO_CONNECTION;
    }
    freeaddrinfo(found);
    if (one != NO_CONNECTION) {
        setsockopt(one, IPPROTO_TCP, TCP_NODELAY, (void *) &yes, sizeof yes);
#ifdef SO_NOSIGPIPE
        setsockopt(one, SOL_SOCKET, SO_NOSIGPIPE, (void *) &yes, sizeof yes);
#endif
    }
    return one;
}

static int open_connection(void)
{
    char name[256];
    const char *why = "no such port";

    memset(name, 0, sizeof name);
    memcpy(name, SERVER_MACHINE_NAME, sizeof SERVER_MACHINE_NAME);
    name[sizeof SERVER_MACHINE_NAME - 1] = '\0';
    if (SERV_TCP_PORT > 0 && SERV_TCP_PORT <= 65535) {
        if (name[0] != '\0')
            connection = dial(name, &why);
        else if (gethostname(name, sizeof name - 1) == 0)
            connection = dial(name, &why);
        if (connection == NO_CONNECTION && SERVER_MACHINE_NAME[0] == '\0')
            connection = dial("localhost", &why); /* a machine may not know its own name */
    }
    if (connection != NO_CONNECTION)
        return 1;
    fprintf(stderr, "Nclient: no server at %s, port %d: %s. Is one running there?\n", name, SERV_TCP_PORT, why);
    return wrong(NCLIENT_NO_CONNECTION);
}

static int transmit(void)
{
    size_t sent = 0, length = 4 + 4 * (size_t) words;
    ssize_t now;

    if (connection == NO_CONNECTION)
        return wrong(NCLIENT_NO_CONNECTION);
    put_pair(message + 2, words);
    while (sent < length) {
        now = send(connection, message + sent, length - sent, MSG_NOSIGNAL);
        if (now >= 0)
            sent += (size_t) now;
        else if (errno != EINTR)
            return lost(strerror(errno));
    }
    return 1;
}

static int receive(unsigned char *place, size_t length)
{
    ssize_t now;

    while (length > 0) {
        now = recv(connection, place, length, 0);
        if (now == 0)
            return lost("the server hung up");
        if (now < 0 && errno != EINTR)
            return lost(strerror(errno));
        if (now > 0) {
            place += now;
            length -= (size_t) now;
        }
    }
    return 1;
}

/* Send the request and have the whole answer in `message`; 0 if there is none or it is an error's. */
static int exchange(void)
{
    int type;

    if (!transmit() || !receive(message, 4))
        return 0;
    type = message[0] << 8 | message[1];
    words = (long) message[2] << 8 | message[3];
    at = 0;
    if (type == NO_MESSAGE)
        return lost("what it says is no message");
    if (!receive(message + 4, 4 * (size_t) words))
        return 0;
    if (type == ERROR_REPLY)
        return wrong(words > 0 && value(0) != 0 ? (int) value(0) : NCLIENT_BAD_REPLY);
    State[STATE_ERROR] = 0;
    return 1;
}

/* ---- the parts of answers */

/* The laser's part begins with how many points or lines it holds, of 1, 2 or 4 numbers each. Which of these depends on
   the laser's mode, of which both sides would need the same opinion; the length of the answer says it as well. */
static int laser_fits(long index, long numbers)
{
    long count = value(index);

    if (count == 0)
        return numbers >= 0;
    return count > 0 && numbers <= 2 * NUM_LASER && (numbers == count || numbers == 2 * count || numbers == 4 * count);
}

static int take_laser(int *laser, long numbers)
{
    int used, i;

    laser[0] = (int) take();
    used = laser[0] == 0 ? 0 : (int) numbers;
    for (i = 1; i <= used; i++)
        laser[i] = (int) take();
    return used;
}

static long place_words(int which)
{
    which &= attached;
    return PLACE_WORDS * ((which & POS_INFRARED ? INFRAREDS : 0) + (which & POS_SONAR ? SONARS : 0) +
                          (which & POS_BUMPER ? 1 : 0) + (which & POS_LASER ? 1 : 0) + (which & POS_COMPASS ? 1 : 0));
}

static void take_places(int which, PosData *places, int count)
{
    PosData *end = places + count;

    if ((which & attached) == 0)
        return;
    for (; places < end; places++) {
        places->config.configX = take();
        places->config.configY = take();
        places->config.configSteer = take();
        places->config.configTurret = take();
        places->config.velTrans = take();
        places->config.velSteer = take();
        places->config.velTurret = take();
        places->config.timeStamp = look(at++);
        places->timeStamp = look(at++);
    }
}

static void take_clock(void)
{
    board_clock = (long) look(at++);
}

/* ---- the kinds of calls, by their answers */

static int ask_state(void)
{
    long numbers;
    int i;

    if (!exchange())
        return 0;
    numbers = words - NUM_STATE - 1 - place_words(~0) - 3;
    if (numbers < 0 || !laser_fits(NUM_STATE, numbers))
        return wrong(NCLIENT_BAD_REPLY);
    for (i = 0; i < NUM_STATE; i++)
        State[i] = take();
    State[STATE_ERROR] = 0;
    laser_used = take_laser(Laser, numbers);
    take_places(POS_INFRARED, infrared_places, INFRAREDS);
    take_places(POS_SONAR, sonar_places, SONARS);
    take_places(POS_BUMPER, &bumper_place, 1);
    take_places(POS_LASER, &laser_place, 1);
    take_places(POS_COMPASS, &compass_place, 1);
    take_clock();
    cpu_battery = (int) (look(at++) & 0xFF);
    motor_battery = (int) (look(at++) & 0xFF);
    return 1;
}

static int ask_entries(int type, int first, int count)
{
    int i;

    begin(type);
    if (!exchange())
        return 0;
    if (words < count)
        return wrong(NCLIENT_BAD_REPLY);
    for (i = first; i < first + count; i++)
        State[i] = take();
    return 1;
}

static int ask_sensors(int type, int first, int count, int which, PosData *places)
{
    int i;

    begin(type);
    if (!exchange())
        return 0;
    if (words < count + place_words(which) + 1)
        return wrong(NCLIENT_BAD_REPLY);
    for (i = first; i < first + count; i++)
        State[i] = take();
    take_places(which, places, count);
    take_clock();
    return 1;
}

static int ask_laser(int type)
{
    long numbers;

    begin(type);
    if (!exchange())
        return 0;
    numbers = words - 1 - place_words(POS_LASER) - 1;
    if (numbers < 0 || !laser_fits(0, numbers))
        return wrong(NCLIENT_BAD_REPLY);
    laser_used = take_laser(Laser, numbers);
    take_places(POS_LASER, &laser_place, 1);
    take_clock();
    return 1;
}

static int ask_three(int type, int first, int second, int third)
{
    begin(type);
    put(first), put(second), put(third);
    return ask_state();
}

static int ask_nothing(int type)
{
    begin(type);
    return ask_state();
}

static int tell(int type)
{
    begin(type);
    return exchange();
}

/* ---- to whom */

static int enrol(int type, long robot)
{
    int old = connection != NO_CONNECTION;

    if (narrow((unsigned long) robot) < 1)
        return wrong(NCLIENT_BAD_ARGUMENT); /* a server takes words that begin with a 0 for some of another layout */
    if (!old && !open_connection())
        return 0;
    begin(type);
    put(robot), put((long) getpid());
    if (!exchange())
        return old && connection == NO_CONNECTION ? enrol(type, robot) : 0; /* that server has gone; is one back? */
    return words > 0 ? (int) take() : wrong(NCLIENT_BAD_REPLY);
}

int connect_robot(long robot_id, ...)
{
    int answer = enrol(CONNECT, robot_id);

    if (answer == 0)
        return 0;
    init_mask();
    attached = POS_NONE;
    ct();
    return connection == NO_CONNECTION ? 0 : answer;
}

int create_robot(long robot_id)
{
    return enrol(CREATE, robot_id);
}

int disconnect_robot(long robot_id)
{
    begin(DISCONNECT);
    put(robot_id), put((long) getpid());
    if (!transmit())
        return 0;
    close(connection);
    connection = NO_CONNECTION;
    return 1;
}

int server_is_running(void)
{
    return connect_robot(1L);
}

int set_server_machine_name(const char *name)
{
    if (name == NULL || strlen(name) >= sizeof SERVER_MACHINE_NAME)
        return wrong(NCLIENT_BAD_ARGUMENT);
    strcpy(SERVER_MACHINE_NAME, name);
    return 1;
}

int set_serv_tcp_port(int port)
{
    SERV_TCP_PORT = port;
    return 1;
}

int quit_server(void) { return tell(70); }
int real_robot(void) { return tell(71); }
int simulated_robot(void) { return tell(74); }

/* ---- moving */

int ac(int first, int second, int third) { return ask_three(10, first, second, third); }
int sp(int first, int second, int third) { return ask_three(11, first, second, third); }
int vm(int first, int second, int third) { return ask_three(12, first, second, third); }
int pr(int first, int second, int third) { return ask_three(13, first, second, third); }
int st(void) { return ask_nothing(17); }
int lp(void) { return ask_nothing(18); }
int zr(void) { return ask_nothing(20); }

int pa(int first, int second, int third)
{
    (void) first;
    (void) second;
    (void) third;
    return 0;
}

int mv(int first_mode, int first, int second_mode, int second, int third_mode, int third)
{
    if (first_mode < MV_IGNORE || first_mode > MV_SP || second_mode < MV_IGNORE || second_mode > MV_SP ||
        third_mode < MV_IGNORE || third_mode > MV_SP)
        return wrong(NCLIENT_BAD_ARGUMENT);
    begin(43);
    put(first_mode), put(first), put(second_mode), put(second), put(third_mode), put(third);
    return ask_state();
}

int ws(int first, int second, int third, int timeout)
{
    begin(39);
    put(first != 0), put(second != 0), put(third != 0), put(timeout & 0xFF);
    return ask_state();
}

int dp(int x, int y)
{
    begin(21);
    put(x), put(y);
    return ask_state();
}

int da(int steering, int turret)
{
    begin(38);
    put(steering), put(turret);
    return ask_state();
}

int place_robot(int x, int y, int steering, int turret)
{
    begin(41);
    put(x), put(y), put(steering), put(turret);
    return exchange();
}

int conf_tm(int seconds)
{
    begin(26);
    put(seconds & 0xFF);
    return ask_state();
}

/* Text travels as machines that keep the low byte first have always sent it: each four characters reversed. */
int tk(const char *text)
{
    size_t length = strlen(text), longest = 4 * MAX_WORDS - 1, i;
    unsigned long group = 0;

    if (length > longest)
        length = longest;
    begin(19);
    for (i = 0; i <= length; i++) {
        if (i < length)
            group |= (unsigned long) (unsigned char) text[i] << 8 * (i % 4);
        if (i % 4 == 3 || i == length) {
            put((long) group);
            group = 0;
        }
    }
    return exchange();
}

/* ---- sensing */

int gs(void) { return ask_nothing(15); }
int get_ir(void) { return ask_sensors(27, STATE_IR_0, INFRAREDS, POS_INFRARED, infrared_places); }
int get_sn(void) { return ask_sensors(28, STATE_SONAR_0, SONARS, POS_SONAR, sonar_places); }
int get_rc(void) { return ask_entries(29, STATE_CONF_X, 4); }
int get_rv(void) { return ask_entries(30, STATE_VEL_TRANS, 3); }
int get_ra(void) { return ask_entries(31, STATE_VEL_TRANS, 3); }
int get_cp(void) { return ask_sensors(32, STATE_COMPASS, 1, POS_COMPASS, &compass_place); }
int get_ls(void) { return ask_laser(33); }
int get_bp(void) { return ask_sensors(35, STATE_BUMPER, 1, POS_BUMPER, &bumper_place); }
int get_sg(void) { return ask_laser(37); }

static long mask_bits(int first, int count)
{
    long bits = 0;
    int i;

    for (i = 0; i < count; i++)
        if (Smask[first + i] > 0)
            bits |= 1L << i;
    return bits;
}

int ct(void)
{
    int before = attached, i;

    attached = Smask[SMASK_POS_DATA] > 0 ? Smask[SMASK_POS_DATA] & 0x1F : POS_NONE;
    begin(16);
    for (i = SMASK_IR_1; i < SMASK_RESERVED; i += 8)
        put(mask_bits(i, 8));
    put(mask_bits(SMASK_POS_DATA, 1) | mask_bits(SMASK_RESERVED, 3) << 1), put(attached);
    if (ask_state())
        return 1;
    attached = before;
    return 0;
}

static int order_of_sensors(int type, int first, int *order)
{
    int i, ended = 0;

    begin(type);
    put(first);
    for (i = 0; i < 16; i++) {
        put(ended ? END_OF_ORDER : order[i]); /* beyond its end there may be nothing to read */
        ended = ended || order[i] < 0 || order[i] > 15;
    }
    return ask_state();
}

int conf_ir(int history, int *order) { return order_of_sensors(22, history, order); }
int conf_sn(int rate, int *order) { return order_of_sensors(23, rate, order); }

int conf_cp(int mode)
{
    begin(24);
    put(mode);
    return ask_state();
}

int conf_ls(int mode, int threshold, int width, int points, int processing)
{
    begin(25);
    put(mode), put(threshold), put(width), put(points), put(processing);
    return ask_state();
}

int conf_sg(int threshold, int least_points, int gap) { return ask_three(36, threshold, least_points, gap); }

void init_mask(void)
{
    int i;

    Smask[SMASK_POS_DATA] = POS_NONE;
    for (i = SMASK_IR_1; i < NUM_MASK; i++)
        Smask[i] = 1;
}

int init_sensors(void)
{
    init_mask();
    return ct();
}

int get_state(long state[NUM_STATE])
{
    memcpy(state, State, sizeof State);
    return 1;
}

int get_laser(int laser[2 * NUM_LASER + 1])
{
    memcpy(laser, Laser, (1 + (size_t) laser_used) * sizeof laser[0]);
    return 1;
}

int get_mask(int mask[NUM_MASK])
{
    memcpy(mask, Smask, sizeof Smask);
    return 1;
}

int set_mask(int mask[NUM_MASK])
{
    memcpy(Smask, mask, sizeof Smask);
    return 1;
}

/* ---- where the robot was when a sensor took its reading */

int posDataRequest(int which)
{
    if ((which & 0x1F) != which)
        return wrong(NCLIENT_BAD_ARGUMENT);
    Smask[SMASK_POS_DATA] = which;
    return ct();
}

int posDataCheck(void) { return attached; }

static int copy_place(PosData *place, const PosData *places, int number, int count)
{
    if (number < 0 || number >= count)
        return wrong(NCLIENT_BAD_ARGUMENT);
    *place = places[number];
    return 1;
}

int posInfraredRingGet(PosData places[INFRAREDS])
{
    memcpy(places, infrared_places, sizeof infrared_places);
    return 1;
}

int posSonarRingGet(PosData places[SONARS])
{
    memcpy(places, sonar_places, sizeof sonar_places);
    return 1;
}

int posInfraredGet(PosData *place, int number) { return copy_place(place, infrared_places, number, INFRAREDS); }
int posSonarGet(PosData *place, int number) { return copy_place(place, sonar_places, number, SONARS); }
int posBumperGet(PosData *place) { return copy_place(place, &bumper_place, 0, 1); }
int posLaserGet(PosData *place) { return copy_place(place, &laser_place, 0, 1); }
int posCompassGet(PosData *place) { return copy_place(place, &compass_place, 0, 1); }
long posTimeGet(void) { return board_clock; }

/* Of each battery a converter sees a part between 2 and 5 V, and gives it as 0 to 255. */
static float volts(int reading, double range)
{
    return (float) ((2.0 + 3.0 * reading / 255.0) * range / 5.0);
}

float voltCpuGet(void) { return volts(cpu_battery, 12.0); }
float voltMotorGet(void) { return volts(motor_battery, 12.85); }

/* ---- the simulated world */

/* A polygon's words; 0 if the array that a caller has for one could not hold it. */
static int put_obstacle(int type, const long *obstacle)
{
    long i;

    if (obstacle[0] < 1 || obstacle[0] > MAX_VERTICES)
        return wrong(NCLIENT_BAD_ARGUMENT);
    begin(type);
    for (i = 0; i <= 2 * obstacle[0]; i++)
        put(obstacle[i]);
    return 1;
}

int add_obstacle(long *obstacle)
{
    return put_obstacle(50, obstacle) && exchange();
}

int delete_obstacle(long *obstacle)
{
    return put_obstacle(51, obstacle) && exchange();
}

int move_obstacle(long *obstacle, long dx, long dy)
{
    long i, count;

    if (!put_obstacle(52, obstacle))
        return 0;
    count = 2 * obstacle[0];
    put(dx), put(dy);
    if (!exchange())
        return 0;
    if (words < count + 1 || value(0) != obstacle[0])
        return wrong(NCLIENT_BAD_REPLY);
    for (i = 0; i <= count; i++)
        obstacle[i] = take();
    return 1;
}

int add_Obs(long *obstacle) { return add_obstacle(obstacle); }
int delete_Obs(long *obstacle) { return delete_obstacle(obstacle); }
int move_Obs(long *obstacle, long dx, long dy) { return move_obstacle(obstacle, dx, dy); }
int new_world(void) { return tell(53); }

int get_robot_conf(long conf[4])
{
    int i;

    begin(200);
    if (!exchange())
        return 0;
    if (words < 4)
        return wrong(NCLIENT_BAD_REPLY);
    for (i = 0; i < 4; i++)
        conf[i] = take();
    return 1;
}

int get_rpx(long *robots)
{
    long i, count;

    begin(75);
    if (!exchange())
        return 0;
    count = words > 0 ? value(0) : -1;
    if (count < 0 || count > NUM_RPX || words < 1 + 3 * count)
        return wrong(NCLIENT_BAD_REPLY);
    for (i = 0; i <= 3 * count; i++)
        robots[i] = take();
    return 1;
}

int predict_sensors(int x, int y, int steering, int turret, long state[NUM_STATE], int laser[2 * NUM_LASER + 1])
{
    long numbers;
    int i;

    begin(42);
    put(x), put(y), put(steering), put(turret);
    if (!exchange())
        return 0;
    numbers = words - STATE_ERROR - 1; /* of the laser, whose part begins where a state's error is */
    if (numbers < 0 || !laser_fits(STATE_ERROR, numbers))
        return wrong(NCLIENT_BAD_REPLY);
    for (i = STATE_IR_0; i < STATE_BUMPER; i++)
        state[i] = value(i);
    for (; i < NUM_STATE; i++)
        state[i] = 0;
    at = STATE_ERROR;
    take_laser(laser, numbers);
    return 1;
}

/* The nearest word to number * scale. */
static long scaled(double number, double scale)
{
    double nearest = number * scale + (number < 0 ? -0.5 : 0.5);

    if (!(nearest > -2147483647.0))
        return -2147483647L;
    return nearest < 2147483647.0 ? (long) nearest : 2147483647L;
}

int motion_check(long type, double a1, double a2, double a3, double a4, double a5, double a6, double a7,
                 double collide[3])
{
    int round = narrow((unsigned long) type) != 0;

    begin(400);
    put(round), put(scaled(a1, 100.0)), put(scaled(a2, 100.0)), put(scaled(a3, round ? 1000000.0 : 100.0));
    put(scaled(a4, round ? 1000000.0 : 100.0)), put(round ? scaled(a5, 100.0) : 0);
    put(round ? scaled(a6, 100.0) : 0), put(round ? scaled(a7, 100.0) : 0);
    if (!exchange())
        return 1;
    if (words > 0 && value(0) == 0)
        return 0;
    if (words < 4) {
        wrong(NCLIENT_BAD_REPLY);
        return 1;
    }
    collide[0] = (double) value(1) / 100.0;
    collide[1] = (double) value(2) / 100.0;
    collide[2] = (double) value(3) / 1000000.0;
    return 1;
}

/* ---- drawing in the server's windows */

int draw_robot(long x, long y, int steering, int turret, int mode)
{
    begin(60);
    put(x), put(y), put(steering), put(turret), put(mode);
    return exchange();
}

int draw_line(long x1, long y1, long x2, long y2, int mode)
{
    begin(61);
    put(x1), put(y1), put(x2), put(y2), put(mode);
    return exchange();
}

int draw_arc(long x, long y, long width, long height, int begin_angle, int end_angle, int mode)
{
    begin(62);
    put(x), put(y), put(width), put(height), put(begin_angle), put(end_angle), put(mode);
    return exchange();
}

int refresh_all(void) { return tell(150); }
int refresh_all_traces(void) { return tell(151); }
int refresh_actual_trace(void) { return tell(152); }
int refresh_encoder_trace(void) { return tell(153); }
int refresh_all_sensors(void) { return tell(154); }
int refresh_bumper_sensor(void) { return tell(155); }
int refresh_infrared_sensor(void) { return tell(156); }
int refresh_sonar_sensor(void) { return tell(157); }
int refresh_laser_sensor(void) { return tell(158); }
int refresh_client_graphics(void) { return tell(159); }

/* ---- packets of bytes */

/* Send a packet and have the answer in `reply`, at most `room` bytes of it: how many there are, 0 for none. */
static long packet(const unsigned char *request, unsigned char *reply, long room)
{
    long length = request[0] | (long) request[1] << 8, i;

    if (length < PACKET_HEAD)
        return wrong(NCLIENT_BAD_ARGUMENT);
    if (length > MAX_PACKET)
        length = MAX_PACKET;
    begin(300);
    for (i = 0; i < length; i++)
        put(request[i]);
    if (!exchange())
        return 0;
    if (words < PACKET_HEAD || words > room)
        return wrong(NCLIENT_BAD_REPLY);
    for (i = 0; i < words; i++)
        reply[i] = (unsigned char) (take() & 0xFF);
    return words;
}

int special_request(unsigned char *request, unsigned char *reply)
{
    return packet(request, reply, USER_BUFFER_LENGTH) > 0;
}

/* Numbers in packets have their low byte first; the highest bit of those that may be negative is their sign. Nothing is
   written or read beyond what the buffer of a packet holds. */
static int holds(unsigned short index, int bytes)
{
    return index + bytes <= USER_BUFFER_LENGTH;
}

static int stuff(unsigned long bits, int bytes, unsigned char *buffer, unsigned short *index)
{
    if (!holds(*index, bytes))
        return wrong(NCLIENT_BAD_ARGUMENT);
    for (; bytes > 0; bytes--, bits >>= 8)
        buffer[(*index)++] = (unsigned char) (bits & 0xFF);
    return *index;
}

static int stuff_signed(long number, int bytes, unsigned char *buffer, unsigned short *index)
{
    unsigned long size, sign = 1UL << (8 * bytes - 1);

    number = narrow((unsigned long) number);
    size = number < 0 ? 0UL - (unsigned long) number : (unsigned long) number;
    return stuff((size & (sign - 1)) | (number < 0 ? sign : 0), bytes, buffer, index);
}

static unsigned long extract(int bytes, const unsigned char *buffer, unsigned short *index)
{
    unsigned long bits = 0;
    int i;

    if (!holds(*index, bytes))
        return (unsigned long) wrong(NCLIENT_BAD_ARGUMENT);
    for (i = 0; i < bytes; i++)
        bits |= (unsigned long) buffer[(*index)++] << 8 * i;
    return bits;
}

static long extract_signed(int bytes, const unsigned char *buffer, unsigned short *index)
{
    unsigned long bits = extract(bytes, buffer, index), sign = 1UL << (8 * bytes - 1);

    return bits & sign ? -(long) (bits & (sign - 1)) : (long) bits;
}

int init_send_buffer(unsigned short *index) { return *index = PACKET_HEAD; }
int init_receive_buffer(unsigned short *index) { return *index = PACKET_HEAD; }

int stuff_send_buffer_header(unsigned short length, unsigned char serial, unsigned char type, unsigned char *buffer)
{
    unsigned short index = 0;

    stuff(length, 2, buffer, &index);
    stuff(serial, 1, buffer, &index);
    stuff(type, 1, buffer, &index);
    return length;
}

int extract_receive_buffer_header(unsigned short *length, unsigned char *serial, unsigned char *type,
                                  unsigned char *buffer)
{
    unsigned short index = 0;

    *length = (unsigned short) extract(2, buffer, &index);
    *serial = (unsigned char) extract(1, buffer, &index);
    *type = (unsigned char) extract(1, buffer, &index);
    return *length;
}

int stuffchar(signed char data, unsigned char *buffer, unsigned short *index)
{
    return stuff_signed(data, 1, buffer, index);
}

int stuff2byteint(signed short data, unsigned char *buffer, unsigned short *index)
{
    return stuff_signed(data, 2, buffer, index);
}

int stuff4byteint(signed long data, unsigned char *buffer, unsigned short *index)
{
    return stuff_signed(data, 4, buffer, index);
}

int stuffuchar(unsigned char data, unsigned char *buffer, unsigned short *index)
{
    return stuff(data, 1, buffer, index);
}

int stuff2byteuint(unsigned short data, unsigned char *buffer, unsigned short *index)
{
    return stuff(data, 2, buffer, index);
}

int stuff4byteuint(unsigned long data, unsigned char *buffer, unsigned short *index)
{
    return stuff(data, 4, buffer, index);
}

signed char extractchar(unsigned char *buffer, unsigned short *index)
{
    return (signed char) extract_signed(1, buffer, index);
}

signed short extract2byteint(unsigned char *buffer, unsigned short *index)
{
    return (signed short) extract_signed(2, buffer, index);
}

signed long extract4byteint(unsigned char *buffer, unsigned short *index)
{
    return extract_signed(4, buffer, index);
}

unsigned char extractuchar(unsigned char *buffer, unsigned short *index)
{
    return (unsigned char) extract(1, buffer, index);
}

unsigned short extract2byteuint(unsigned char *buffer, unsigned short *index)
{
    return (unsigned short) extract(2, buffer, index);
}

unsigned long extract4byteuint(unsigned char *buffer, unsigned short *index)
{
    return extract(4, buffer, index);
}

/* Where byte `i` of a double is in memory when its low byte counts as the first: its sign is in its last. */
static int place_in_double(int i)
{
    const double negative = -1.0;

    return *(const unsigned char *) &negative & 0x80 ? (int) sizeof negative - 1 - i : i;
}

int stuffdouble(double data, unsigned char *buffer, unsigned short *index)
{
    int i;

    if (!holds(*index, sizeof data))
        return wrong(NCLIENT_BAD_ARGUMENT);
    for (i = 0; i < (int) sizeof data; i++)
        stuff(((const unsigned char *) &data)[place_in_double(i)], 1, buffer, index);
    return *index;
}

double extractdouble(unsigned char *buffer, unsigned short *index)
{
    double data = 0.0;
    int i;

    if (!holds(*index, sizeof data)) {
        wrong(NCLIENT_BAD_ARGUMENT);
        return data;
    }
    for (i = 0; i < (int) sizeof data; i++)
        ((unsigned char *) &data)[place_in_double(i)] = (unsigned char) extract(1, buffer, index);
    return data;
}

/* ---- the arm */

/* Send the arm the packet whose data end at `end`; the result that it gives, 0 for none. time_left: NULL for an answer
   that tells none. */
static int ask_arm(unsigned char *request, unsigned short end, int type, long *time_left)
{
    unsigned char reply[ARM_PACKET];
    unsigned short index;
    long length;
    int result;

    stuff_send_buffer_header(end, 0, (unsigned char) type, request);
    length = packet(request, reply, ARM_PACKET);
    if (length == 0)
        return 0;
    if (length < (time_left ? 12 : 8))
        return wrong(NCLIENT_BAD_REPLY);
    init_receive_buffer(&index);
    result = (int) extract4byteint(reply, &index);
    if (time_left)
        *time_left = extract4byteint(reply, &index);
    return result;
}

int arm_zero(int override)
{
    unsigned char request[6];
    unsigned short index;

    init_send_buffer(&index);
    stuff_signed(override, 2, request, &index);
    return ask_arm(request, index, 40, NULL);
}

int arm_zr(int override) { return arm_zero(override); }

int arm_ws(int lift, int gripper, long timeout, long *time_left)
{
    unsigned char request[12];
    unsigned short index;
    long left = 0;
    int result;

    init_send_buffer(&index);
    stuff_signed(lift, 2, request, &index);
    stuff_signed(gripper, 2, request, &index);
    stuff_signed(timeout, 4, request, &index);
    result = ask_arm(request, index, 41, &left);
    if (time_left != NULL)
        *time_left = left;
    return result;
}

int arm_mv(long lift_mode, long lift, long gripper_mode, long gripper)
{
    unsigned char request[20];
    unsigned short index;

    init_send_buffer(&index);
    stuff4byteint(lift_mode, request, &index);
    stuff4byteint(lift, request, &index);
    stuff4byteint(gripper_mode, request, &index);
    stuff4byteint(gripper, request, &index);
    return ask_arm(request, index, 42, NULL);
}
