import { useEffect } from "react";
import { useTranslation } from "react-i18next";
import { listFlightLogs } from "../../api/resources";
import type { Flight, FlightLog } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Icon } from "../../controls/Icon";
import { Empty, Loaded } from "../../controls/states";
import { awaitsLog } from "../../flights/logs";
import { useResource } from "../../live/use_resource";

const ASK_MS = 4_000;

const TITLES = { ulg: "flights.log_ulog", bin: "flights.log_dataflash", tlog: "flights.log_tlog" } as const;

/** What the drone has written of a flight, and the broker of its messages, to be downloaded. */
export function FlightLogs({ flight }: { flight: Flight }) {
  const { t } = useTranslation();
  const logs = useResource(() => listFlightLogs(flight.id), `${flight.id} ${flight.ended_at}`);
  const { value, reload } = logs;
  useEffect(() => {
    const timer = setInterval(() => {
      if (!document.hidden && awaitsLog(flight, value ?? [], Date.now())) reload();
    }, ASK_MS);
    return () => clearInterval(timer);
  }, [flight, value, reload]);
  const isExpected = awaitsLog(flight, value ?? [], Date.now());
  return (
    <>
      <h2>{t("flights.logs")}</h2>
      <Loaded
        resource={logs}
        empty={
          <Empty icon="download" title={t(isExpected ? "flights.log_expected" : "flights.no_log")} />
        }
      >
        {(rows) => (
          <div className="actions">
            {rows.map((log) => (
              <LogLink key={log.id} log={log} />
            ))}
          </div>
        )}
      </Loaded>
    </>
  );
}

function LogLink({ log }: { log: FlightLog }) {
  const { t } = useTranslation();
  const units = useUnits();
  if (log.url === null) {
    const part = Math.floor((100 * log.received_bytes) / log.size_bytes);
    return <p className="muted">{t("flights.log_received", { part, size: units.data(log.size_bytes) })}</p>;
  }
  return (
    <a className="button button-plain" href={log.url} download={log.file_name}>
      <Icon name="download" />{" "}
      {t(TITLES[log.format], { size: units.data(log.size_bytes) })}
    </a>
  );
}
