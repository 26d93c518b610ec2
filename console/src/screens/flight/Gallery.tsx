import { useEffect, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Picture } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { Dialog } from "../../controls/Dialog";
import { Icon } from "../../controls/Icon";

/** Half a minute: a board makes one thumbnail of a large picture in a second. */
const ATTEMPTS = 8;
const RETRY_MS = 1_000;

/** The pictures of a flight; the one with the number `open` is shown in full, the arrow keys change it. */
export function Gallery({ pictures, open, show }: {
  pictures: Picture[];
  open: number | null;
  show: (id: number | null) => void;
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

function FullPicture({ picture, place, before, next, close }: {
  picture: Picture;
  place: string;
  before: (() => void) | null;
  next: (() => void) | null;
  close: () => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const [failedUrl, setFailedUrl] = useState<string | null>(null);
  const title = t("flights.picture", { id: picture.id });
  return (
    <Dialog
      title={title}
      close={close}
      kind="gallery"
      tools={
        <a className="button button-plain" href={picture.url} download={`picture-${picture.id}`}>
          <Icon name="download" /> <span>{t("flights.picture_download")}</span>
        </a>
      }
      onKeyDown={(event) => {
        if (event.key === "ArrowLeft") before?.();
        if (event.key === "ArrowRight") next?.();
      }}
    >
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
    </Dialog>
  );
}
