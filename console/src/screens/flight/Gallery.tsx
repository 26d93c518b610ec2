import { useEffect, useLayoutEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Picture } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { Icon } from "../../controls/Icon";
import { StopButton } from "../../controls/StopButton";

const ATTEMPTS = 2;
const RETRY_MS = 1_000;

/** The pictures of a flight; the one with the number `open` is shown in full, the arrow keys change it. */
export function Gallery({ pictures, open, show, stop }: {
  pictures: Picture[];
  open: number | null;
  show: (id: number | null) => void;
  stop: () => void;
}) {
  const index = pictures.findIndex((one) => one.id === open);
  const picture = pictures[index];
  const [before, next] = [pictures[index - 1], pictures[index + 1]];
  return (
    <>
      <div className="pictures">
        {pictures.map((one) => (
          <button key={one.id} type="button" onClick={() => show(one.id)}>
            <Thumbnail picture={one} />
          </button>
        ))}
      </div>
      {picture && (
        <FullPicture
          picture={picture}
          place={`${index + 1} / ${pictures.length}`}
          before={before ? () => show(before.id) : null}
          next={next ? () => show(next.id) : null}
          close={() => show(null)}
          stop={stop}
        />
      )}
    </>
  );
}

/** A small picture; the edge server makes few at once, so one that it refuses is asked for again. */
function Thumbnail({ picture }: { picture: Picture }) {
  const { t } = useTranslation();
  const [attempt, setAttempt] = useState(0);
  const [isShown, setShown] = useState(true);
  useEffect(() => {
    if (isShown || attempt >= ATTEMPTS) return;
    const timer = setTimeout(() => {
      setAttempt(attempt + 1);
      setShown(true);
    }, RETRY_MS * (1 + attempt));
    return () => clearTimeout(timer);
  }, [isShown, attempt]);
  const name = t("flights.picture", { id: picture.id });
  if (!isShown) return <span className="picture-missing" role="img" aria-label={name}><Icon name="picture" /></span>;
  return (
    <img
      key={attempt}
      src={picture.thumbnail_url ?? picture.url}
      alt={name}
      loading="lazy"
      onError={() => setShown(false)}
    />
  );
}

function FullPicture({ picture, place, before, next, close, stop }: {
  picture: Picture;
  place: string;
  before: (() => void) | null;
  next: (() => void) | null;
  close: () => void;
  stop: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const dialog = useRef<HTMLDialogElement>(null);
  // Closed before it leaves the page: the browser then gives the focus back to where it was
  useLayoutEffect(() => {
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
          <Icon name="download" /> <span>{t("flights.picture_download")}</span>
        </a>
        <Button kind="quiet" icon="close" aria-label={t("action.close")} onClick={close} />
        <StopButton stop={stop} />
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
