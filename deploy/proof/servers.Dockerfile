# PostgreSQL and Mosquitto of Debian, started as their public images are: for deploy/prove.sh.
FROM localhost/farm/debian-servers
COPY --chmod=0755 postgres_entry.sh /usr/local/bin/postgres_entry.sh
RUN ln -s /usr/lib/postgresql/*/bin/* /usr/local/bin/ \
    && mkdir -p /mosquitto/data /mosquitto/config /var/lib/postgresql/data \
    && chown 1883:1883 /mosquitto/data
ENV PATH=/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
CMD ["postgres_entry.sh"]
