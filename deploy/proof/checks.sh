# What is looked at in the running system; sourced by deploy/prove.sh.

profiles=sim,acceptance,tester,postgres,mqtt,setup
json() { python3 -c "import json, sys; d = json.load(sys.stdin); print($1)"; }
seconds_since() { python3 -c "import sys, time; print(f'{time.time() - float(sys.argv[1]):.1f} s')" "$1"; }
key() { cat "$SECRETS_DIR/$1.key"; }
edge_url=http://$PUBLISH
ask() { curl --silent --show-error --fail --max-time 10 "$@"; }
edge() { ask -H "X-API-Key: $(key operator)" "$edge_url$1" "${@:2}"; }
cloud() { ask "http://$PUBLISH_CLOUD$1"; }

# Waits until a command gives something other than nothing and False.
until_true() {
    local what=$1 patience=$2 found
    shift 2
    local end=$((SECONDS + patience))
    until found=$("$@" 2>/dev/null) && [[ -n $found && $found != False ]]; do
        ((SECONDS < end)) || fail "not after $patience s: $what"
        sleep 0.5
    done
}

system_up() {
    local start name
    start=$(date +%s.%N)
    compose "$@" up --detach --no-build
    for name in $(containers); do
        until_true "$name is healthy" 120 is_well "$name"
    done
    echo "healthy after $(seconds_since "$start"): $(containers | tr '\n' ' ')"
}

# Asks as a daemon with a clock would; podman leaves the asking to systemd, which is not here.
is_well() {
    [[ $(podman inspect --format '{{if .Config.Healthcheck}}asks{{end}}' "$1") != asks ]] ||
        podman healthcheck run "$1" >/dev/null 2>&1 || return 1
    podman inspect --format '{{.State.Running}}' "$1" | sed 's/false/False/'
}

system_down() {
    COMPOSE_PROFILES=$profiles compose down --volumes --remove-orphans --timeout 20
}

check_isolation() {
    local name secret
    for name in $(containers); do
        podman exec "$name" sh -c '
            set -e
            [ "$(id -u)" != 0 ]
            ! grep -E "^Cap(Prm|Eff|Bnd):" /proc/1/status | grep -qv 0000000000000000
            grep -q "^NoNewPrivs:.*1" /proc/1/status
            ! touch /opt/farm/app/new 2>/dev/null' ||
            fail "$name has a right that it does not need"
        for secret in "$SECRETS_DIR"/*; do
            ! podman inspect "$name" | grep --quiet --fixed-strings "$(tail -n 1 "$secret")" ||
                fail "$name carries $(basename "$secret") in its configuration"
        done
    done
    echo "every program: no root, no capability, nothing to write but its volume, no secret in view"
}

check_networks() {
    local name=${project}_vehicle-1_1
    podman exec "$name" python -c 'import socket; socket.gethostbyname("broker")' ||
        fail "the vehicle does not find the broker"
    ! podman exec "$name" python -c 'import socket; socket.gethostbyname("edge-server")' \
        2>/dev/null || fail "the vehicle sees the edge server"
    echo "the vehicle finds the broker by name, and not the edge server"
}

vehicles_connected() {
    edge /vehicles/ | json "sum(v['link_state'] == 'connected' for v in d) == 2"
}

ended() {
    edge "/plans/$1" | json "all(m['mission_status_id'] >= 3 for m in d['missions'])"
}

nothing_kept() {
    [[ $(edge /pose/) == '[]' && $(edge /mission_report/) == '[]' && $(edge /battery/) == '[]' ]] &&
        echo True
}

fly_by_curl() {
    local start number states
    until_true "both vehicles are connected" 120 vehicles_connected
    start=$(date +%s.%N)
    number=$(edge /plans/ -H 'Content-Type: application/json' --data "@$1" | json "d['id']")
    until_true "plan $number has ended" 900 ended "$number"
    states=$(edge "/plans/$number" | json "[m['mission_status_id'] for m in d['missions']]")
    [[ $states == '[3]' ]] || fail "plan $number ended as $states, not FINISHED"
    echo "plan $number is FINISHED, $(seconds_since "$start") after its POST at SPEED=$SPEED"
    until_true "the edge server has delivered everything" 60 nothing_kept
    [[ $(cloud /mission_report | json "d[-1]['body']['mission_status_id']") == 3 ]] ||
        fail "the cloud lacks the last mission report"
    echo "the cloud holds $(cloud / | json "d['counts']")"
}

address_of() {
    podman inspect --format \
        "{{(index .NetworkSettings.Networks \"${project}_vehicles\").IPAddress}}" "$1"
}

move_broker() {
    local name=${project}_broker_1 before
    before=$(address_of "$name")
    podman kill --signal KILL "$name" >/dev/null
    compose rm --force broker
    compose up --detach --no-build broker
    until_true "the broker is healthy" 60 is_well "$name"
    [[ $(address_of "$name") != "$before" ]] || fail "the broker has come back at $before"
    echo "the broker was at $before and is at $(address_of "$name")"
}

check_stop_and_start() {
    local start name plans code
    plans=$(edge /plans/ | json 'len(d)')
    start=$(date +%s.%N)
    COMPOSE_PROFILES=sim compose stop
    echo "stopped after $(seconds_since "$start")"
    for name in $(podman ps --all --format '{{.Names}}' --filter "name=^${project}_"); do
        code=$(podman inspect --format '{{.State.ExitCode}}' "$name")
        ((code == 0)) || fail "$name ended with $code"
    done
    system_up --profile sim
    [[ $(edge /plans/ | json 'len(d)') == "$plans" ]] || fail "plans are missing"
    echo "all ended with 0, and $plans plans are still there"
}

status_of() {
    curl --silent --output /dev/null --write-out '%{http_code}' -H "X-API-Key: $1" \
        "$edge_url/plans/"
}

check_new_key() {
    local old prefix
    old=$(key operator)
    prefix=$(cut -d_ -f2 <<<"$old")
    compose --profile setup run --rm setup \
        python -m deploy.secret_files /secrets --replace operator.key
    compose up --detach --no-build --force-recreate edge-server
    until_true "the edge server is healthy" 120 is_well "${project}_edge-server_1"
    [[ $(status_of "$old") == 200 && $(status_of "$(key operator)") == 200 ]] ||
        fail "one of the two keys does not open"
    compose exec -T edge-server python -m edge_server keys revoke "$prefix"
    until_true "the old key opens nothing" 30 old_key_is_refused "$old"
    [[ $(status_of "$(key operator)") == 200 ]] || fail "the new key does not open"
    echo "the old operator key opens nothing any more, the new one does"
}

old_key_is_refused() { [[ $(status_of "$1") == 401 ]] && echo True; }

check_backup() {
    compose exec -T edge-server python -m edge_server backup /var/lib/farm/backup.sqlite3
    compose exec -T edge-server cat /var/lib/farm/backup.sqlite3 >"$work/backup.sqlite3"
    compose exec -T edge-server rm /var/lib/farm/backup.sqlite3
    python3 -c "
import sqlite3, sys
copy = sqlite3.connect(sys.argv[1])
assert copy.execute('PRAGMA integrity_check').fetchone() == ('ok',)
print('the backup is whole, with', copy.execute('SELECT count(*) FROM plan').fetchone()[0], 'plans')
" "$work/backup.sqlite3"
}
