import { useEffect, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Picture } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { Dialog } from "../../controls/Dialog";
import { Icon } from "../../controls/Icon";
import { useIsNear } from "../../controls/use_is_near";
import { Turns } from "../../flights/turns";

/** Half a minute: a board makes one thumbnail of a large picture in a second. */
const ATTEMPTS = 8;
const RETRY_MS = 1_000;

/** The edge server makes one thumbnail at a time, and lets three wait. */
const turns = new Turns(3);

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
          <Thumbnail key={one.id} picture={one} show={() => show(one.id)} />
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

/** A button with a small picture, loaded in its turn; one that is refused is asked for again. */
function Thumbnail({ picture, show }: { picture: Picture; show: () => void }) {
  const { t } = useTranslation();
  const place = useRef<HTMLButtonElement>(null);
  const isNear = useIsNear(place, false, "page");
  const [attempt, setAttempt] = useState(0);
  const [isWanted, setWanted] = useState(true);
  const [hasTurn, setTurn] = useState(false);
  const [isLoaded, setLoaded] = useState(false);
  useEffect(() => {
    if (!isNear || !isWanted || isLoaded) return;
    const end = turns.take(() => setTurn(true));
    return () => {
      end();
      setTurn(false);
    };
  }, [isNear, isWanted, isLoaded]);
  useEffect(() => {
    if (isWanted || attempt >= ATTEMPTS) return;
    const timer = setTimeout(() => {
      setAttempt(attempt + 1);
      setWanted(true);
    }, RETRY_MS * (1 + attempt));
    return () => clearTimeout(timer);
  }, [isWanted, attempt]);
  const name = t("flights.picture", { id: picture.id });
  return (
    <button ref={place} type="button" onClick={show}>
      {hasTurn || isLoaded ? (
        <img
          key={attempt}
          src={picture.thumbnail_url ?? picture.url}
          alt={name}
          onLoad={() => setLoaded(true)}
          onError={() => setWanted(false)}
        />
      ) : (
        <span className="picture-missing" role="img" aria-label={name}>
          <Icon name="picture" />
        </span>
      )}
    </button>
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
      <div className="gallery-foot">
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
      </div>
    </Dialog>
  );
}
