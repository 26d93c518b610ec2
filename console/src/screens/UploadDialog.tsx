import { useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { RequestError } from "../api/client";
import { createPlan, importPlan } from "../api/resources";
import type { Plan, PlanDocument } from "../api/types";
import { go } from "../app/route";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { SelectField, TextField } from "../controls/fields";
import { FaultList, Notice } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { useLive } from "../live/use_live";
import { asRequestError } from "../live/use_resource";
import { newMissionId, renumberedFrom, withoutTimes } from "../planning/plan_document";
import { Attempts, newKey } from "../planning/saving";

class NotAPlanError extends Error {}

/** Stores a plan file as a draft: a plan document, or a ground station's mission file. */
export function UploadDialog({ close }: { close: () => void }) {
  const { t } = useTranslation();
  const vehicles = useLive((state) => state.vehicles);
  const [file, setFile] = useState<File | null>(null);
  const [vehicleId, setVehicleId] = useState<number | null>(null);
  const [error, setError] = useState<RequestError | NotAPlanError | null>(null);
  const [isBusy, setBusy] = useState(false);
  const [attempts] = useState(() => new Attempts());
  const chosen = vehicleId ?? [...vehicles.keys()][0] ?? 1;

  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (file === null) return;
    setBusy(true);
    const content = [file.name, file.size, file.lastModified, chosen];
    attempts.run(content, file, (sent, key) => upload(sent, chosen, key))
      .then((plan) => {
        close();
        go(`plans/${plan.id}`);
      })
      .catch((reason: unknown) =>
        setError(reason instanceof NotAPlanError ? reason : asRequestError(reason)),
      )
      .finally(() => setBusy(false));
  };
  return (
    <Dialog title={t("plans.upload_title")} close={close}>
      <p className="muted">{t("plans.upload_text")}</p>
      {error instanceof NotAPlanError && <Notice kind="error">{t("plans.not_json")}</Notice>}
      {error !== null && !(error instanceof NotAPlanError) && (
        <Notice kind="error">
          <p>{error.faults.length > 0 ? t("error.422") : describeError(error, t)}</p>
          <FaultList faults={error.faults} />
        </Notice>
      )}
      <form className="card-form" onSubmit={submit}>
        <TextField
          label={t("plans.upload_file")}
          type="file"
          accept=".json,.plan,.waypoints,.txt"
          onChange={(event) => setFile(event.target.files?.[0] ?? null)}
          required
        />
        <SelectField
          label={t("plans.upload_vehicle")}
          value={chosen}
          onChange={(event) => setVehicleId(Number(event.target.value))}
        >
          {[...vehicles.keys()].map((id) => (
            <option key={id} value={id}>
              {t("vehicle.name", { id })}
            </option>
          ))}
        </SelectField>
        <div className="dialog-actions">
          <Button onClick={close}>{t("action.cancel")}</Button>
          <Button kind="primary" icon="upload" type="submit" isBusy={isBusy} disabled={file === null}>
            {t("plans.upload")}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}

/** The content decides, not the name: a .plan of a ground station is JSON too. */
async function upload(file: File, vehicleId: number, key: string): Promise<Plan> {
  const text = await file.text();
  if (text.startsWith("QGC WPL") || /\.waypoints$/i.test(file.name)) return importPlan(file, vehicleId, key);
  let document: unknown;
  try {
    document = JSON.parse(text);
  } catch {
    throw new NotAPlanError();
  }
  if (typeof document !== "object" || document === null) throw new NotAPlanError();
  if ("fileType" in document) return importPlan(file, vehicleId, key);
  const bare = "plan" in document && typeof document.plan === "object" ? document.plan : document;
  return createHeld((bare ?? document) as PlanDocument, key);
}

/** Stores a document as a draft; under new numbers where its plan is here already, or its time is over. */
async function createHeld(document: PlanDocument, key: string): Promise<Plan> {
  const held = { ...document, dispatch: false };
  try {
    return await createPlan(held, key);
  } catch (reason) {
    const { status, faults } = asRequestError(reason);
    const isTaken = status === 409 && Array.isArray(held.missions);
    const isOver = status === 422 && faults.length > 0 && faults.every(({ path }) => path === "expires_at");
    if (!isTaken && !isOver) throw reason;
    return createPlan(renumberedFrom(withoutTimes(held), newMissionId(Date.now())), newKey());
  }
}
