#!/usr/bin/env bash
# Builds the images from nothing, starts deploy/compose.yaml and flies missions through it.
#
#   deploy/prove.sh [postgres] [mqtt] [tls]
#
# Needs root on a Debian machine; installs the builder's packages where they are missing. No
# daemon and no registry take part: the base image is made here from this machine's apt sources,
# Python packages come by this machine's pip configuration. Everything lies in PROOF_DIR (a new
# folder under TMPDIR) and is removed at the end; KEEP=1 keeps it, and a second run builds only
# what has changed.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
proof=$root/deploy/proof
work=${PROOF_DIR:-$(mktemp -d -t farm-proof.XXXXXX)}
mkdir -p "$work"
PUBLISH=127.0.0.1:${PROOF_EDGE_PORT:-18000}
PUBLISH_CLOUD=127.0.0.1:${PROOF_CLOUD_PORT:-18100}
PUBLISH_MAVLINK=127.0.0.1:${PROOF_MAVLINK_PORT:-18540}
PUBLISH_MQTT=127.0.0.1:${PROOF_MQTT_PORT:-18830}
SPEED=${SPEED:-5}
CLOUD_URL=http://cloud:8100
export CLOUD_URL PUBLISH PUBLISH_CLOUD PUBLISH_MAVLINK PUBLISH_MQTT SPEED

say() { printf '\n== %s\n' "$*"; }
fail() {
    printf 'FAILED: %s\n' "$*" >&2
    exit 1
}

source "$proof/engine.sh"
source "$proof/images.sh"
source "$proof/checks.sh"
source "$proof/variants.sh"

exec {lock}>"$work/lock"
flock --nonblock "$lock" || fail "another proof runs in $work"
trap engine_stop EXIT
say "tools"
engine_install
engine_start

say "images"
images_base
images_build "$root"
images_list

say "secrets"
compose --profile setup run --rm setup

say "the whole system, and a mission by curl"
system_up --profile sim
check_isolation
check_networks
fly_by_curl "$root/examples/plans/first_flight.json"

say "the broker is killed and made anew at another address, and a plan is accepted"
move_broker
compose --profile acceptance run --rm acceptance

say "a person stands in for a vehicle"
compose --profile tester run --rm -T tester </dev/null

say "a new key, and a backup"
check_new_key
check_backup

say "stop, start, and what was kept is there"
check_stop_and_start
system_down

for profile in "$@"; do
    say "once more with $profile"
    "use_$profile"
    system_up "${with[@]}"
    compose --profile acceptance run --rm acceptance
    "check_$profile"
    system_down
    use_nothing_more
done

say "proved"
