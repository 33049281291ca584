#!/bin/sh
# network_test.sh HELPER: telemetry over UDP multicast, with lcm-logger and lcm-logplayer, in network namespaces of its
# own: nothing leaves the computer. Exit 77: skipped, the reason on stdout.
set -u

helper=$1
url='udpm://239.255.76.67:7667?ttl=0'
records=1000

if [ "${2:-}" != inside ]; then
  for program in unshare ip lcm-logger lcm-logplayer; do
    command -v "$program" >/dev/null || { echo "SKIPPED: $program is not installed"; exit 77; }
  done
  if ! reason=$(unshare -n true 2>&1); then
    echo "SKIPPED: a private network namespace is not permitted here ($reason); run as root"
    exit 77
  fi

  # Without a route: a clear error with the two commands that fix it.
  text=$(unshare -n "$helper" publish "$url" 1 0 /dev/null 2>&1)
  status=$?
  case $text in
    *"no route for multicast to 239.255.76.67:7667"*"ip link set lo up multicast on"*"ip route add 224.0.0.0/4 dev lo"*) ;;
    *) echo "FAILED: no clear error without a route, but: $text"; exit 1 ;;
  esac
  [ $status = 3 ] || { echo "FAILED: exit status $status without a route"; exit 1; }

  # The commands that the error names.
  exec unshare -n sh -c 'ip link set lo up multicast on; ip route add 224.0.0.0/4 dev lo; exec "$@"' -- sh "$0" "$helper" inside
fi

scratch=$(mktemp -d)
# Ends what this script left running, which `jobs` knows, and nothing else.
# shellcheck disable=SC2154  # job: the loop variable
trap 'for job in $(jobs -p); do kill "$job" 2>/dev/null; done; rm -rf "$scratch"' EXIT

fail() { echo "FAILED: $*"; exit 1; }

# Waits until N sockets of this namespace listen on LCM's port, 7667 = 0x1DF3, and then for LCM to enter its handlers,
# which cannot be seen from outside.
wait_for_listeners() {
  tries=0
  until [ "$(grep -c ':1DF3 ' /proc/net/udp)" -ge "$1" ]; do
    tries=$((tries + 1))
    [ $tries -lt 200 ] || fail "no $1 listeners within 10 s"
    sleep 0.05
  done
  sleep 0.3
}

wait_for_no_listeners() {
  tries=0
  while grep -q ':1DF3 ' /proc/net/udp; do
    tries=$((tries + 1))
    [ $tries -lt 200 ] || fail "listeners stay"
    sleep 0.05
  done
}

echo '-- live: a subscriber and lcm-logger'
"$helper" subscribe "$url" $records &
subscriber=$!
# lcm-logger holds 30 messages, and no more whatever its URL says: 30 ms at 1 kHz, which a virtual machine's host or disk
# can take. Slower, 150 ms, and with precedence it misses none (it at 1 kHz: app_interop; 1 and 10 kHz: app_subscribers).
period_us=5000
precedence=''
chrt -f 10 true 2>/dev/null && precedence='chrt -f 10'
$precedence lcm-logger -q --lcm-url="$url" "$scratch/logger.lcmlog" &
logger=$!
wait_for_listeners 2
"$helper" publish "$url" $records $period_us "$scratch/own.lcmlog" || fail 'publisher'
wait $subscriber || fail 'the live subscriber missed messages'
kill -INT $logger
wait $logger
wait_for_no_listeners

for log in own logger; do
  echo "-- $log.lcmlog: read, and replayed by lcm-logplayer"
  "$helper" check-log "$scratch/$log.lcmlog" $records || fail "$log.lcmlog is not complete"
  "$helper" subscribe "$url" $records &
  subscriber=$!
  wait_for_listeners 1
  lcm-logplayer --speed=4 --lcm-url="$url" "$scratch/$log.lcmlog" >/dev/null || fail "lcm-logplayer $log.lcmlog"
  wait $subscriber || fail "the replay of $log.lcmlog missed messages"
  wait_for_no_listeners
done

echo '-- ABS_COMMAND: an unknown command is refused, stop ends the run'
"$helper" publish "$url" 60000 1000 "$scratch/stopped.lcmlog" >"$scratch/stopped.txt" &
publisher=$!
wait_for_listeners 1
"$helper" command "$url" dance || fail 'sending a command'
sleep 0.2
kill -0 $publisher || fail 'an unknown command ended the run'
"$helper" command "$url" stop || fail 'sending stop'
wait $publisher || fail 'the stopped publisher'
grep -q 'stops 1' "$scratch/stopped.txt" || fail 'stop was not heard'
grep -aq "refused 'dance'" "$scratch/stopped.lcmlog" || fail 'the refusal was not answered'
grep -aq "stop accepted (sender 'network_test')" "$scratch/stopped.lcmlog" || fail 'stop was not answered'
echo 'all well'
