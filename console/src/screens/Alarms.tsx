import { useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { acknowledgeAlarm, listAlarms } from "../api/resources";
import type { Alarm } from "../api/types";
import { usePreferences, useUnits } from "../app/preferences";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { MoreRows } from "../controls/MoreRows";
import { Empty, ErrorNotice, Loaded } from "../controls/states";
import { Pill } from "../controls/StatusPill";
import { nameOfAlarm, typeOfAlarm, whatToDo } from "../i18n/describe_alarm";
import { useReportText } from "../i18n/use_report_text";
import { useFeed, useLive } from "../live/use_live";
import { asRequestError, useResource } from "../live/use_resource";
import { Missing } from "./Missing";

/** Alarms of all vehicles, the newest first; each stays open until somebody acknowledges it. */
export default function Alarms() {
  const { t } = useTranslation();
  const { preferences, change } = usePreferences();
  const live = useLive((state) => state.alarms);
  const stored = useResource(listAlarms);
  const rows = useMemo(() => {
    if (stored.value === null) return null;
    const all = new Map(stored.value.map((alarm) => [alarm.id, alarm]));
    for (const alarm of live.values()) all.set(alarm.id, alarm);
    return [...all.values()].sort((one, other) => other.id - one.id);
  }, [stored.value, live]);
  return (
    <div className="screen">
      <header className="screen-head">
        <h1>{t("alarms.title")}</h1>
        <Button
          icon={preferences.isMuted ? "soundOff" : "sound"}
          onClick={() => change({ isMuted: !preferences.isMuted })}
        >
          {t(preferences.isMuted ? "alarms.unmute" : "alarms.mute")}
        </Button>
      </header>
      <div className="card">
        <Loaded
          resource={{ ...stored, value: rows }}
          missing={<Missing />}
          empty={<Empty icon="check" title={t("alarms.empty_title")} text={t("alarms.empty_text")} />}
        >
          {(alarms) => (
            <MoreRows rows={alarms}>{(alarm) => <AlarmRow key={alarm.id} alarm={alarm} />}</MoreRows>
          )}
        </Loaded>
      </div>
    </div>
  );
}

function AlarmRow({ alarm }: { alarm: Alarm }) {
  const { t } = useTranslation();
  const units = useUnits();
  const feed = useFeed();
  const isOperator = useIsOperator();
  const [error, setError] = useState<RequestError | null>(null);
  const [isBusy, setBusy] = useState(false);
  const reportText = useReportText();
  const name = nameOfAlarm(alarm, t);
  const acknowledge = () => {
    setBusy(true);
    acknowledgeAlarm(alarm.id)
      .then((changed) =>
        feed.take("alarm", changed ?? { ...alarm, acknowledged_at: new Date().toISOString() }),
      )
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  return (
    <li>
      <div className="row-main">
        <strong>{name}</strong>
        <span>
          {t("vehicle.name", { id: alarm.vehicle_id })} · {typeOfAlarm(alarm, t)} ·{" "}
          {units.time(alarm.recorded_at)}
        </span>
        {alarm.description && alarm.description !== name && <span>{reportText(alarm.description)}</span>}
        <p className="what-to-do">
          <strong>{t("alarms.what_to_do")}</strong> {whatToDo(alarm, t)}
        </p>
        {error && <ErrorNotice error={error} />}
      </div>
      {alarm.acknowledged_at === null ? (
        <>
          <Pill tone="bad">{t("alarms.open")}</Pill>
          {isOperator && (
            <Button icon="check" isBusy={isBusy} onClick={acknowledge}>
              {t("alarms.acknowledge")}
            </Button>
          )}
        </>
      ) : (
        <span className="muted small">
          {t("alarms.acknowledged", { time: units.time(alarm.acknowledged_at) })}
        </span>
      )}
    </li>
  );
}
