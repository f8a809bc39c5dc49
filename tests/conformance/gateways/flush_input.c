/* For modbus-relay on a pseudo-terminal: TCIOFLUSH drops what has come, and not what was just sent.
 *
 * modbus-relay writes a request, waits until it is sent, and then drops both queues of the port. A serial port has sent
 * everything by then. A pseudo-terminal does not wait, and the request would be dropped itself.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <termios.h>

int tcflush(int descriptor, int queues) {
    int (*next)(int, int) = (int (*)(int, int))dlsym(RTLD_NEXT, "tcflush");
    return next(descriptor, queues == TCIOFLUSH ? TCIFLUSH : queues);
}
