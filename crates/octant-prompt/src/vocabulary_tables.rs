//! Prior knowledge of ordinary flats and offices, written by hand as plain text: a line per entry, words normalised and singular.
//!
//! Read once by [`crate::vocabulary`]. Add a word here and every part of the crate knows it.

/// Synonyms; the first word is the canonical one.
pub const SYNONYMS: &str = "\
sofa, couch, settee, loveseat, sectional
tv, television, tv set, television set, telly, tv screen, flat screen tv
monitor, computer monitor, computer screen, screen, display
trash can, trash bin, garbage can, garbage bin, waste bin, wastebasket, waste basket, rubbish bin, trashcan, dustbin, bin, litter bin, trash, \
    wastebin, garbage
recycling bin, recycle bin, recycling can
fridge, refrigerator, icebox
stove, cooker, hob, cooktop, stovetop
oven
microwave, microwave oven
dishwasher, dish washer
sink, washbasin, basin, wash basin, kitchen sink, bathroom sink, lavatory
toilet, commode, loo, toilet bowl
bathtub, tub, bath tub, bath
shower, shower cabin, shower stall
washing machine, washer, clothes washer, laundry machine
dryer, tumble dryer, clothes dryer
mug, coffee mug, tea mug, beer mug
cup, teacup, tea cup, coffee cup, paper cup
glass, drinking glass, water glass, wine glass, tumbler
bottle, water bottle, wine bottle
plate, dish, dinner plate
bowl, fruit bowl
pot, cooking pot, saucepan, stockpot
pan, frying pan, skillet
kettle, electric kettle, tea kettle, teakettle
coffee machine, coffee maker, espresso machine, coffeemaker
toaster
chair
office chair, desk chair, swivel chair, task chair, computer chair, rolling chair
armchair, arm chair, easy chair, lounge chair, recliner, sofa chair
stool, bar stool, barstool
bench
ottoman, footstool, pouf, foot stool, footrest
table
dining table, dinner table, dining room table
coffee table, cocktail table
nightstand, night stand, bedside table, night table, bedside cabinet
end table, side table
desk, work desk, writing desk, office desk, workstation, computer desk
meeting table, conference table, boardroom table
shelf, shelving, shelving unit, shelf unit, rack
bookshelf, bookcase, book shelf, book case, bookrack
wardrobe, closet, armoire, wardrobe closet
dresser, chest of drawers, drawers, drawer, bureau, chest of drawer
cabinet, cupboard
kitchen cabinet, kitchen cupboard
file cabinet, filing cabinet
counter, countertop, kitchen counter, worktop, counter top
bed
pillow, cushion, throw pillow
blanket, duvet, quilt, comforter
curtain, drape, drapes, window curtain
rug, carpet, area rug
doormat, door mat
lamp
table lamp, desk lamp, reading lamp, bedside lamp
floor lamp, standing lamp
light, ceiling light, light fixture, ceiling lamp
plant, potted plant, houseplant, house plant, pot plant, flowerpot, flower pot, indoor plant
picture, painting, poster, picture frame, photo, artwork, framed picture, photograph, wall picture
mirror
clock, wall clock
whiteboard, white board, dry erase board
blackboard, chalkboard, black board
book, paperback, textbook
laptop, laptop computer, notebook computer
computer, computer tower, pc, desktop computer, pc tower
keyboard, computer keyboard
mouse, computer mouse
printer
photocopier, copier, copy machine, copying machine
phone, telephone, smartphone, cell phone, mobile phone, cellphone, desk phone
speaker, loudspeaker
backpack, rucksack, knapsack, back pack, book bag, bookbag
suitcase, luggage, trolley case
bag, handbag, purse
box, cardboard box, carton, package
basket
hamper, laundry basket, laundry hamper
towel, bath towel, hand towel
soap, soap bottle
soap dispenser
toilet paper, toilet roll, toilet tissue
paper towel dispenser
umbrella
umbrella stand
coat rack, coat stand, hat stand, coat hanger, clothes rack
shoe, sneaker, boot
shoe rack, shoe shelf
bicycle, bike
vase, flower vase
candle
remote, remote control, tv remote
guitar
piano
fan, electric fan
radiator, heater
air conditioner, ac, air conditioning unit
fire extinguisher, extinguisher
water cooler, water dispenser, water fountain
vending machine, snack machine
projector, beamer
projector screen, projection screen
cart, trolley
ladder, stepladder, step ladder
toolbox, tool box, tool chest
broom
mop
bucket, pail
iron, clothes iron
ironing board
vacuum cleaner, vacuum, hoover
game console, console, gaming console
teddy bear, stuffed animal, plush toy, soft toy, stuffed toy
toy
magazine
newspaper
notebook, notepad
pen, pencil
jacket, coat
person, human, man, woman, child
stairs, staircase, stair, stairway
server rack, server cabinet, server
workbench, work bench
tv stand, tv table, media console, tv cabinet
crib, baby bed, cot
scale, bathroom scale
cutting board, chopping board
knife
door
window
fruit, apple, banana, orange fruit
kitchen table, breakfast table
alarm clock
sideboard, credenza, buffet
storage rack, storage shelf, metal rack
paper stack, paper
reception desk, front desk
console table, hall table
shoe cabinet
lab bench
microscope
";

/// Classes that a camera confuses.
pub const LOOK_ALIKES: &str = "\
mug, cup, glass
desk, table, dining table, meeting table, workbench, kitchen table, console table, reception desk, lab bench, counter
coffee table, end table, nightstand, ottoman, table
sofa, armchair
chair, armchair, office chair, stool
shelf, bookshelf, storage rack
cabinet, kitchen cabinet, file cabinet, dresser, wardrobe, shelf, counter, sideboard, shoe cabinet
dresser, nightstand
tv, monitor, projector screen
backpack, bag, suitcase
box, basket, hamper
trash can, recycling bin, bucket, hamper
whiteboard, projector screen, blackboard, picture
plant, vase
bottle, vase, soap
stove, oven
washing machine, dishwasher, dryer
printer, photocopier, microwave
microwave, oven, toaster
book, magazine, notebook, laptop
lamp, floor lamp, table lamp, light
plate, bowl
pot, pan, kettle
towel, blanket
rug, doormat
mirror, picture, window
bench, stool, ottoman
toilet, bathtub
kettle, coffee machine
phone, remote
keyboard, laptop
cabinet, fridge
broom, mop
clock, alarm clock
sideboard, tv stand, console table
";

/// What stands where the first thing is: the next best thing to look at when no known object bears its name.
pub const STAND_INS: &str = "\
window, windowsill, window sill, blinds, blind, curtain, shade, shutter
door, doorframe, door frame, doorway, entrance, front entrance, entry, exit, gate, closet door, shower door
doorway, door, doorframe
entrance, door, doorframe
exit, door, doorframe
sink, bathroom vanity, bathroom counter, faucet, counter, kitchen counter
vanity, bathroom vanity, sink, bathroom counter
shower, shower curtain, shower wall, shower door, shower head, bathtub, shower floor
bathtub, shower curtain, shower
stove, range hood, oven, stove hood
oven, stove, range hood
hood, range hood
closet, closet door, closet wall, clothes, wardrobe, closet rod, closet floor
wardrobe, closet, closet door, clothes
bed, headboard, mattress, bunk bed, pillow, blanket
headboard, bed
foot, bed
computer, computer tower, monitor, keyboard, laptop, desk
monitor, computer, laptop, tv
screen, monitor, projector screen, tv
tv, tv stand, monitor, entertainment center
television, tv stand
desk, table, counter, monitor
table, desk, counter, coffee table, dining table
shelf, rack, bookshelf, cabinet, books
bookshelf, shelf, book
counter, kitchen counter, bathroom counter, bar, kitchen island, kitchen cabinet, cabinet, sink
bar, counter, kitchen counter, kitchen island
island, kitchen island, kitchen counter
dresser, cabinet, drawer, nightstand
drawer, dresser, cabinet, file cabinet
cabinet, kitchen cabinet, wardrobe, counter
stall, bathroom stall, bathroom stall door
sofa, armchair, bench
couch, sofa chair, armchair, seat
armchair, sofa chair, sofa, chair, seat
seat, chair, sofa, armchair, bench
whiteboard, board, blackboard, bulletin board
blackboard, whiteboard, board
board, whiteboard, blackboard, bulletin board
coffee machine, coffee maker, kitchen counter
machine, copier, printer, vending machine, washing machine, coffee maker
copier, printer
printer, copier
trash can, recycling bin, trash bin, container
stairs, stair rail, rail, railing, banister
lamp, light, nightstand
light, lamp
plant, potted plant, plants, flower
picture, poster, board, decoration, mirror
toilet, toilet paper, toilet seat cover dispenser
fridge, mini fridge
radiator, heater
heater, radiator
paper, paper bag, papers, folder, book
towel, towel rack, rail, bar
coat, jacket, clothes, coat rack, hat
clothes, clothing, jacket, shirt
shoe, shoes, slippers
wall, bulletin board, column, pillar
column, pillar
pillar, column
mirror, bathroom mirror, sink
person, people
";

/// Functional groups and their classes.
pub const GROUPS: &str = "\
seating: chair, office chair, armchair, stool, bench, sofa, ottoman
work: table, desk, meeting table, coffee table, dining table, end table, workbench, counter, computer, laptop, keyboard, mouse, printer, photocopier, \
    phone, pen, notebook, kitchen table, console table, reception desk, lab bench, microscope, paper stack
storage: cabinet, kitchen cabinet, file cabinet, shelf, bookshelf, wardrobe, dresser, box, basket, hamper, cart, suitcase, backpack, bag, shoe rack, \
    coat rack, toolbox, server rack, tv stand, book, sideboard, storage rack, shoe cabinet
display: tv, monitor, projector, projector screen, whiteboard, blackboard, picture, mirror, clock, alarm clock
sleep: bed, pillow, blanket, nightstand, crib
kitchen: fridge, stove, oven, microwave, dishwasher, mug, cup, glass, bottle, plate, bowl, pot, pan, kettle, coffee machine, toaster, water cooler, \
    vending machine, cutting board, knife, fruit
wash: sink, toilet, bathtub, shower, towel, soap, soap dispenser, toilet paper, washing machine, dryer, scale, iron, ironing board
light: lamp, table lamp, floor lamp, light, candle, window, curtain
decor: plant, vase, rug, doormat, piano, guitar, teddy bear, toy
clean: trash can, recycling bin, broom, mop, bucket, vacuum cleaner
";

/// Things that are seen from across a room.
pub const LARGE_OR_FIXED: &str = "\
armchair, bathtub, bed, bench, bicycle, blackboard, bookshelf, cabinet, chair, coat rack, console table, counter, crib, curtain, desk, dishwasher, \
    door, dresser, dryer, floor lamp, fridge, lab bench, nightstand, oven, photocopier, piano, plant, reception desk, rug, server rack, shelf, shower, \
    sideboard, sink, sofa, stairs, stool, storage rack, stove, table, toilet, tv, tv stand, vending machine, wardrobe, washing machine, whiteboard, \
    window, workbench
";

/// Room kinds: `kind | other names | contents, the most telling first`.
pub const ROOMS: &str = "\
kitchen | kitchen, kitchenette, galley, pantry kitchen, tea kitchen | stove, oven, fridge, dishwasher, counter, kitchen cabinet, microwave, kettle, \
    toaster, sink, pot, pan, plate, bowl, mug, cup, coffee machine, glass, cutting board, bottle, knife, dining table, fruit, trash can, cabinet, stool, \
    chair, table, kitchen table
living room | living room, lounge, sitting room, family room, livingroom, parlor, parlour, living area | sofa, tv, coffee table, tv stand, armchair, \
    remote, rug, game console, speaker, floor lamp, bookshelf, piano, guitar, pillow, ottoman, plant, vase, picture, magazine, book, blanket, \
    candle, end table, lamp, mug
bedroom | bedroom, master bedroom, guest room, guest bedroom, sleeping room | bed, nightstand, wardrobe, pillow, blanket, dresser, table lamp, teddy \
    bear, alarm clock, mirror, lamp, rug, curtain, book, phone, picture, suitcase, armchair, laptop
bathroom | bathroom, washroom, restroom, wc, toilet room, shower room, rest room, mens room, ladies room, bath room | toilet, shower, bathtub, toilet \
    paper, towel, soap, soap dispenser, sink, mirror, scale, hamper, washing machine, cabinet, trash can
office | office, study, workroom, home office, open office, work room, study room | desk, office chair, computer, keyboard, mouse, monitor, laptop, \
    printer, file cabinet, phone, bookshelf, notebook, pen, table lamp, backpack, book, trash can, whiteboard, lamp, mug, plant, cabinet, clock
meeting room | meeting room, conference room, boardroom, board room, seminar room, classroom, meetingroom | meeting table, projector, projector \
    screen, whiteboard, tv, office chair, chair, phone, laptop, plant, clock, bottle, table, monitor, cup, glass, notebook, picture
dining room | dining room, dining area, dinner room, diningroom | dining table, sideboard, chair, candle, cabinet, vase, plate, glass, table, bowl, \
    picture, rug, plant, bottle, light
corridor | corridor, hallway, hall, passage, entrance, entry, entryway, foyer, vestibule, passageway, entrance hall, stairwell, landing | coat rack, \
    shoe rack, umbrella stand, doormat, shoe cabinet, console table, shoe, fire extinguisher, umbrella, jacket, bench, water cooler, picture, mirror, \
    clock, rug, plant, stairs
storage | storage, storage room, storeroom, pantry, utility room, supply room, store room, storage closet, closet room, supply closet, garage, \
    workshop, basement | storage rack, ladder, broom, mop, bucket, toolbox, vacuum cleaner, box, cart, shelf, bicycle, suitcase, basket, fan, cabinet, \
    hamper, ironing board
laundry room | laundry room, laundry, wash room | washing machine, dryer, ironing board, iron, hamper, basket, towel, sink, shelf, bucket, mop
break room | break room, canteen, cafeteria, staff room, coffee corner, coffee room, tea room, lunch room, breakroom | vending machine, coffee \
    machine, water cooler, microwave, fridge, mug, cup, sink, sofa, table, kettle, chair, stool, counter, trash can, plate, bottle, plant, magazine
print room | print room, copy room, printer room, copier room, mail room | photocopier, printer, paper stack, recycling bin, newspaper, shelf, box, \
    cabinet, counter, trash can
server room | server room, machine room, data room | server rack, air conditioner, computer, fire extinguisher, cabinet, monitor, keyboard
lab | lab, laboratory, iot lab, iot laboratory | microscope, lab bench, workbench, computer, monitor, stool, shelf, toolbox, cabinet, keyboard, \
    laptop, sink, fire extinguisher, box, desk, fan
lobby | lobby, reception, waiting room, waiting area, reception area | reception desk, magazine, sofa, armchair, plant, water cooler, coffee table, \
    newspaper, umbrella stand, counter, clock, picture, bench, rug, vase
library | library, reading room | bookshelf, book, armchair, magazine, desk, table lamp, floor lamp, ladder, newspaper, table, rug
nursery | nursery, childrens room, kids room, child room, playroom, kid room | crib, teddy bear, toy, bed, rug, desk, book, dresser, box, lamp
";

/// Colour words with reference colours (sRGB, 0-255).
pub const COLORS: &str = "\
red 190 40 40
green 60 140 70
blue 50 90 180
yellow 220 200 60
orange 230 130 40
brown 120 80 50
black 30 30 32
white 235 235 232
gray 130 130 130
grey 130 130 130
silver 180 182 186
pink 230 150 170
purple 120 60 140
violet 120 60 140
beige 215 200 170
cream 235 225 200
tan 200 170 125
turquoise 60 180 175
teal 30 125 125
golden 200 165 70
gold 200 165 70
maroon 110 35 40
navy 35 45 95
dark 45 42 40
ivory 235 230 210
lavender 180 160 200
";

/// Materials; the first word is the canonical one.
pub const MATERIALS: &str = "\
wood, wooden, oak, pine, bamboo
metal, metallic, steel, iron, aluminium, aluminum
plastic
leather
fabric, cloth, textile, wool, cotton, velvet
ceramic, porcelain
stone, marble, granite
paper, cardboard
rubber
wicker, rattan
glass, glassy
";

/// Ordinary words that are spelled right though they are close to one of ours: nobody who says them means the other.
pub const ORDINARY: &str = "\
chain tower trowel owl coach beach peach boat goat moat coal coats lamb limp lump camp damp ramp stamp clamp pear pearl bear deer hair \
pair stair air fair flair choir cello cellar collar dollar color colour plane plan planet plank plain planter crane crate cradle \
candy canoe cane cone cage cake case cash cast castle cattle battle rattle bottles bottleneck table stable cable label fable tablet \
bath bathe path math moth mouth month south north mouse moose goose loose louse house horse hose rose nose pose nurse purse curse \
pool tool wool fool spool stole stone stool stove store storm story star stain start state stamp stall stem steam stew stick still \
sting stock stop drawer draw drum dress drink drip drive drop broom bloom groom room boom doom brush crush bread breed break brick bride \
bridge fridge ridge brief bring broad broth brother bucket jacket racket rocket pocket socket ticket wicket basket casket biscuit blanket \
planket bench bunch branch lunch punch trench wench bell belt bend best nest pest rest test vest west bet bit bite byte bike like lake \
bake cap cat cap cop cow crow crown cub cube cud cuff cup cut cute cutter butter mutton button better letter litter leather feather \
weather whether father mother rather ladder lather bladder leader reader header heater eater meter metre heat seat meat neat beat boot \
boots root foot food wood hood mood moon noon spoon soon sand hand band land wand stand brand grand grandma grandpa baby lady man woman \
boy girl dog puppy kitten cat bird fish snake horse pony sheep pig hen duck duke lion tiger elephant giraffe zebra dragon unicorn \
dinosaur mermaid pirate robot train rain brain drain grain car cart card cord corn horn born barn bar bark park dark shark sharp shape \
ship shop shirt short shore shelf self shell sheet shed shadow shovel shower flower tower power lower slower follower tractor truck \
track trick brick bus taxi tram van plane helicopter submarine rocket ship yacht canoe kayak surfboard skateboard snowboard sled sledge \
ski skis trumpet trombone violin viola flute harp organ drum drums accordion banjo tent rope hammock swing slide sandbox trampoline \
treadmill dumbbell barbell aquarium terrarium fountain statue globe map flag anvil hammer nail saw drill wrench pliers screw screwdriver \
axe sword knight shield crown throne altar fork spoon ladle tray jar jug lid pin pen pan pot pit pet put pat net nut not hut hat hit hot \
rat bat mat sat fat rug rag tag tap top tip tie toe tea ten tin ton son sun gun fun run bun bin fin win wing ring king sing song long \
sock socks glove gloves scarf shawl skirt trousers jeans shorts belt boots sandal slipper necklace bracelet watch wallet key keys coin \
coins money bill bills letter letters stamp stamps envelope parcel gift present balloon kite puzzle doll dice chess cards deck clown \
camera tripod lens film radio stereo record records turntable headphones microphone charger battery cable socket plug switch fuse \
bread cheese milk egg eggs ham meat rice pasta pizza soup salad onion potato tomato carrot lemon orange melon grape cherry berry nut \
cookie cookies chocolate sugar salt pepper oil honey jam beer wine juice water ice cream hand hands foot feet head face eye eyes ear ears \
mouth tooth teeth leg legs arm arms back knee finger here hear were wear ware where there their then than them they thin think thing things \
this that these those what when which while who whom whose why how about after again all also always am among another are away because \
been before being below both but came come could day does done down each even ever every few first from gave give given good got great \
had has have her hers him his home into its just keep kept kind knew know large last least left less let like little live look made make \
many may maybe mine more most much must myself never new next nice night none nothing now number off often old once only other our ours out \
over own part people perhaps place put quite rather ready really right said same saw say see seen sent set several shall she should show \
side since small some soon still such sure take taken tell than thank thanks time times today together told tomorrow tonight too took \
toward tried try turn two under until upon use used using usual very wait walk want wanted was way well went were wet whole will wish \
with within without word work world would write year yes yesterday yet you young your yours myself yourself himself herself itself ourselves \
hungry thirsty tired cold warm hot dirty clean wash washed washes watch watches cook cooks cooked cooking sleep sleeps slept sleeping eat \
eats eating drink drinks drinking read reads reading sit sits sitting boil boils boiled boiling bake bakes baked baking dry dries dried \
drying hang hangs hung iron irons sweep sweeps throw throws threw thrown trash call calls called print prints printed copy copies copied \
please friend friends guest guests guy guys sir madam dude buddy mate hello okay sorry excuse quick quickly asap around anywhere somewhere \
edge base piece kind type direction length roll portion section middle center top bottom row pair stack pile group bunch couple cluster line \
nowhere everywhere someone somebody anyone anybody nobody everyone everybody fire fires smoke burn burns burning light lights bright dark \
sauna gym garden yard balcony terrace roof attic chapel theater theatre cinema museum school hospital office floor ceiling wall walls \
";

/// What things are for: `classes: one use, another use`; each use a few words that all have to be said, in any form.
pub const USES: &str = "\
kettle: boil water, boiled water, hot water, heat water, make tea, brew tea, cup tea
coffee machine: make coffee, brew coffee, get coffee, want coffee, need coffee, have coffee, cup coffee, drink coffee, espresso, cappuccino
sink: wash hand, clean hand, rinse, wash dish, brush tooth, brush teeth, wash face
dishwasher: dirty plate, dirty dish, clean plate machine, wash plate, clean dish, clean dish machine, wash dish machine, wash dish automatically
washing machine: wash clothes, wash shirt, wash trousers, do laundry, clean clothes, wash laundry, wash sock, dirty clothes machine, launder
dryer: dry clothes, dry laundry, dry shirt, dry sock, wet clothes
fridge: cold drink, keep cold, keep food, cool food, cool drink, keep milk, cold milk, food cold, food fresh, stay cold, cold beer, store food, keep cool
stove: cook, fry, simmer, boil pasta, boil egg, cook food, heat pan
oven: bake, roast, bake cake, bake bread, bake pizza
microwave: warm food, warm up food, heat food, heat meal, warm meal, reheat, leftover, warm lunch, heat lunch
toaster: toast, toast bread, make toast, brown bread
bed: sleep, lie down, nap, go to sleep, lay down, spend night, take rest
chair, office chair, armchair, sofa, stool, bench: sit, sit down, take seat, have seat
lamp, table lamp, floor lamp: light to read, give light, light up, turn light, more light, shine
tv: watch film, watch movie, watch news, watch show, watch series, watch football, watch match, watch program
printer: print, print document, print page, print letter
photocopier: make copy, copy document, copy page, copy letter, duplicate, copy paper, photocopy
phone: make call, call somebody, call someone, call mother, ring somebody, dial, phone call, call friend, call home
keyboard: type, type text, press letter
monitor: show computer picture, see computer picture
clock: what time, tell time, time is it, show time, see time, show hour, read time, how late
mirror: see myself, look myself, see face, see yourself, look yourself, reflection, check hair, comb hair, do hair, reflect
toilet: pee, relieve, use restroom, flush, nature call
bathtub: take bath, have bath, bathe, soak
shower: take shower, have shower
towel: dry hand, dry myself, dry off, dry face, dry body
soap dispenser: soap hand
trash can: throw away, throw this, throw something, throw garbage, throw rubbish, throw out, get rid, dispose, put garbage, put rubbish, put waste, put trash, bin this
vacuum cleaner: clean carpet, clean rug, suck dust, suck dirt, vacuum, clean floor machine, hoover
broom: sweep, sweep floor
mop: mop floor, wipe floor
iron: iron shirt, press shirt, wrinkle, smooth shirt
bookshelf: keep book, store book, book stand, shelve book, book kept, put book
book: something read, want read, like read
wardrobe: hang clothes, keep clothes, store clothes, hang shirt, hang dress, put clothes, dress myself
coat rack: hang coat, hang jacket, leave coat, put coat, hang hat, coat hang
umbrella: keep rain, against rain, rain outside
fire extinguisher: put out fire, put fire, extinguish, stop fire, fight fire, fire out, flame out, put flame
whiteboard: write marker, draw marker, write wall, write meeting, wipe off
projector: project, project slide, show slide, throw picture
piano: play music key, play tune key
plant: needs water leaf, has leaf, green leaf, grow, to water, photosynthesis
mug, cup: drink tea from, drink coffee from, drink from
glass: drink water from, drink wine
plate: eat from, eat off, serve food
knife: cut bread, slice, cut vegetable
pillow: rest head, lay head, put head
blanket: cover myself, keep warm night
desk: work at, write at, do homework, study at, write letter
dining table: eat dinner, have dinner, have meal, eat meal, eat together, have lunch, eat lunch, dine, eat at
suitcase: pack clothes, travel with, pack trip, pack journey
backpack: carry back, wear back
fan: blow air, move air, cool air
radiator: warm room, heat room, heat up room, warm up room, give heat, give warmth, keep warm room, warm myself
air conditioner: cool room, cool down room
ladder: climb, reach ceiling, reach high
toolbox: keep tool, find tool, hold tool, hammer, screwdriver, wrench, repair, fix something, tool
microscope: tiny thing, look tiny, see tiny, small thing look, see small, look cell, see cell, magnify, enlarge, bacteria
scale: weigh, how heavy
hamper: put dirty clothes, dirty laundry, dirty sock, put laundry, collect laundry, worn clothes
vending machine: buy snack, buy drink, sell snack, buy sweet, buy candy
water cooler: drink water, fill bottle, glass water, get water
teddy bear: cuddle, cuddly
remote: change channel, switch channel, switch tv, turn tv
vase: put flower, hold flower, keep flower, cut flower
crib: baby sleep, put baby
bicycle: ride, pedal
";

/// What rooms are for, in the same form.
pub const ROOM_USES: &str = "\
kitchen: cook, prepare food, prepare meal, make food, make dinner, make breakfast, food made, bake
bedroom: sleep, spend night, go to bed
bathroom: take bath, have bath, take shower, have shower, brush tooth, brush teeth, shower, bathe, wash myself
living room: watch tv, watch film, relax, watch movie, sit together
dining room: eat, have dinner, have meal, dine
office: work, do homework
laundry room: wash clothes, do laundry, clothes washed, dry clothes
storage: store thing, keep tool, keep stuff, things stored
meeting room: meet, have meeting, hold meeting, confer
";
