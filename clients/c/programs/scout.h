/* scout.h: what programs that drive one Scout have in common: options, how they begin and end, how they wander. */
#ifndef SCOUT_H
#define SCOUT_H

/* What a person may say on the command line. */
struct scout {
    const char *host;   /* -h: of the server, "" for this machine */
    int port;           /* -p: of the server */
    int robot;          /* -r: from 1 */
    int rate;           /* -f: pause of the sonars, in 4 ms */
    int pause;          /* -w: ms between two loops, 0 for a server in lockstep */
    int loops;          /* -n: after which to end, 0 for never */
    int datagrams;      /* -d: port at which to hear them */
    const char *listen; /* -l: address at which to hear them */
    int leave;          /* -q: end as soon as it has stopped */
};

/* Read the options that `allowed` names, as getopt() wants them; ends the program with a line of usage at others. */
void read_options(int argc, char **argv, const char *allowed, struct scout *scout);

int begin_scout(const struct scout *scout); /* connect and set up; 0 if it cannot be */
int goes_on(const struct scout *scout);     /* whether there is another loop to do; counts it */
int end_scout(const struct scout *scout);   /* stop and hang up; the status to end with */

long nearest_front(void); /* inches to the nearest thing that the front sonars see */
int wander(void);         /* one step of going about without touching anything; 0 if the robot does not answer */

#endif
