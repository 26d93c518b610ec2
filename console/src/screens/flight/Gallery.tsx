import { useEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Picture } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { Icon } from "../../controls/Icon";

/** The pictures of a flight; one is shown in full, the arrow keys change it. */
export function Gallery({ pictures }: { pictures: Picture[] }) {
  const { t } = useTranslation();
  const [open, setOpen] = useState<number | null>(null);
  const picture = open === null ? undefined : pictures[open];
  return (
    <>
      <div className="pictures">
        {pictures.map((one, index) => (
          <button key={one.id} type="button" onClick={() => setOpen(index)}>
            <img
              src={one.thumbnail_url ?? one.url}
              alt={t("flights.picture", { id: one.id })}
              loading="lazy"
            />
          </button>
        ))}
      </div>
      {picture && open !== null && (
        <FullPicture
          picture={picture}
          place={`${open + 1} / ${pictures.length}`}
          before={open > 0 ? () => setOpen(open - 1) : null}
          next={open < pictures.length - 1 ? () => setOpen(open + 1) : null}
          close={() => setOpen(null)}
        />
      )}
    </>
  );
}

function FullPicture({ picture, place, before, next, close }: {
  picture: Picture;
  place: string;
  before: (() => void) | null;
  next: (() => void) | null;
  close: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    const element = dialog.current;
    element?.showModal();
    return () => element?.close();
  }, []);
  const [failedUrl, setFailedUrl] = useState<string | null>(null);
  const title = t("flights.picture", { id: picture.id });
  return (
    <dialog
      ref={dialog}
      className="dialog gallery"
      aria-label={title}
      onCancel={(event) => {
        event.preventDefault();
        close();
      }}
      onKeyDown={(event) => {
        if (event.key === "ArrowLeft") before?.();
        if (event.key === "ArrowRight") next?.();
      }}
    >
      <header>
        <h2>{title}</h2>
        <a className="button button-plain" href={picture.url} download={`picture-${picture.id}`}>
          <Icon name="download" /> {t("flights.picture_download")}
        </a>
        <Button kind="quiet" icon="close" aria-label={t("action.close")} onClick={close} />
      </header>
      {failedUrl === picture.url ? (
        <p className="gallery-missing">{t("flights.picture_unreadable")}</p>
      ) : (
        <img key={picture.url} src={picture.url} alt={title} onError={() => setFailedUrl(picture.url)} />
      )}
      <footer>
        <Button icon="back" disabled={before === null} onClick={() => before?.()}>
          {t("flights.picture_before")}
        </Button>
        <span className="muted" aria-live="polite">
          {place} · {units.clock(picture.recorded_at)}
          {picture.altitude !== null && <> · {units.height(picture.altitude)}</>}
        </span>
        <Button disabled={next === null} onClick={() => next?.()}>
          {t("flights.picture_next")}
        </Button>
      </footer>
    </dialog>
  );
}
