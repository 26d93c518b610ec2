# The system with PostgreSQL, with MQTT and with TLS; sourced by deploy/prove.sh.

with=(--profile sim)

use_env() {
    images_stand_ins
    set -a
    source "$root/deploy/$1.env"
    set +a
    with=(--profile sim --profile "$1")
}
use_postgres() { use_env postgres; }
use_mqtt() { use_env mqtt; }

# An authority of the farm's own, and what it says of the edge server.
use_tls() {
    local folder=$SECRETS_DIR
    openssl req -x509 -newkey rsa:2048 -nodes -days 1 -subj '/CN=farm authority' \
        -keyout "$work/authority.key" -out "$folder/authority.crt" 2>/dev/null
    openssl req -newkey rsa:2048 -nodes -subj '/CN=edge-server' \
        -keyout "$folder/edge-server.key" -out "$work/edge-server.csr" 2>/dev/null
    openssl x509 -req -days 1 -in "$work/edge-server.csr" -out "$folder/edge-server.crt" \
        -CA "$folder/authority.crt" -CAkey "$work/authority.key" -CAcreateserial \
        -extfile <(echo 'subjectAltName=DNS:edge-server,IP:127.0.0.1') 2>/dev/null
    chown 10001:10001 "$folder"/{authority.crt,edge-server.crt,edge-server.key}
    chmod 0400 "$folder/edge-server.key"
    compose_files+=(--file "$root/deploy/tls.yaml")
}

use_nothing_more() {
    unset DATABASE_URL CLOUD_MQTT_URL
    CLOUD_URL=http://cloud:8100
    compose_files=(--file "$root/deploy/compose.yaml")
    with=(--profile sim)
}

check_postgres() {
    ! podman exec "${project}_edge-server_1" test -e /var/lib/farm/edge/edge.sqlite3 ||
        fail "there is a SQLite database"
    podman exec "${project}_postgres_1" sh -c '
        PGPASSWORD=$(cat /run/secrets/postgres.password) \
            psql --host=127.0.0.1 --username=farm --no-align --tuples-only \
            --command="SELECT count(*) || '\'' plan in PostgreSQL'\'' FROM plan"'
}

check_mqtt() {
    podman logs "${project}_relay_1" 2>&1 | grep --quiet 'MQTT: connected' ||
        fail "the relay has not logged in at the MQTT broker"
    # An MQTT 3.1.1 CONNECT without user and password; CONNACK with code 5: not authorised.
    [[ $(podman exec "${project}_relay_1" python -c '
import socket
with socket.create_connection(("mqtt", 1883), 5) as broker:
    broker.sendall(b"\x10\x0e\x00\x04MQTT\x04\x02\x00\x3c\x00\x02me")
    print(broker.recv(4).hex())') == 20020005 ]] || fail "the MQTT broker takes anybody"
    echo "the relay has logged in at the MQTT broker, which refuses who has no password"
}

check_tls() {
    ask --cacert "$SECRETS_DIR/authority.crt" "https://$PUBLISH/readyz"
    ! ask "http://$PUBLISH/readyz" 2>/dev/null || fail "plain HTTP is answered"
    echo " over TLS, and plain HTTP is not answered"
}
